//! A rig that is another one from half of the poses on.

use super::fault::{Fault, Step, half_way};
use super::session::{BOTH, LEFT, RIGHT, Session};
use crate::optics::CameraOptics;
use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::Vector3;

pub(super) const FAULTS: &[Fault] = &[
    half_way(
        "focus-both",
        &["focus-changed"],
        Step::Session(|session, _| change(session, BOTH, |camera| camera.refocused(1.001))),
    ),
    half_way(
        "focus-left",
        &["focus-changed"],
        Step::Session(|session, _| change(session, LEFT, |camera| camera.refocused(1.001))),
    ),
    half_way(
        "half-size",
        &["image-size"],
        Step::Session(|session, _| change(session, BOTH, CameraOptics::half_size)),
    ),
    half_way(
        "window-both",
        &["window-shifted"],
        Step::Session(|session, _| {
            change(session, BOTH, |camera| camera.window_moved([40.0, 24.0]));
        }),
    ),
    half_way(
        "window-right",
        &["window-shifted"],
        Step::Session(|session, _| {
            change(session, RIGHT, |camera| camera.window_moved([4.0, 0.0]));
        }),
    ),
    half_way(
        "right-turned",
        &["camera-moved"],
        Step::Session(|session, _| turn_right(session)),
    ),
    half_way(
        "baseline",
        &["baseline-changed", "camera-moved"],
        Step::Session(|session, _| {
            for take in session.second_half(RIGHT) {
                take.left_from_camera.translation_mm *= 1.001;
            }
        }),
    ),
];

fn change(session: &mut Session, cameras: &[usize], to: impl Fn(&CameraOptics) -> CameraOptics) {
    for take in session.second_half(cameras) {
        take.camera = to(&take.camera);
    }
}

/// Turns the right camera by 0.02 degrees about its vertical axis.
fn turn_right(session: &mut Session) {
    let turn = so3::exp(&Vector3::new(0.0, 0.02_f64.to_radians(), 0.0));
    let before_from_after = RigidTransform::new(turn, Vector3::zeros());
    for take in session.second_half(RIGHT) {
        take.left_from_camera = take.left_from_camera * before_from_after;
    }
}
