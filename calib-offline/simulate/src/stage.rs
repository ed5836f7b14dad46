//! The rotation stage: where the board stands at each placement and angle.

use super::random::{self, Purpose};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// One way of standing the stage before the rig. Bench frame: midway between the cameras, x right,
/// y down, z towards the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Placement {
    /// Azimuth (to the right) and elevation (upwards) of the stage as seen from the bench origin,
    /// degrees; the stage turns with it, so that the board faces the rig.
    pub look_deg: [f64; 2],
    /// Shift right and down across that direction, mm.
    pub shift_mm: [f64; 2],
    /// Distance of the board (at angle 0) along it, mm.
    pub distance_mm: f64,
    /// Tilt of the axis in the image and towards the rig, degrees; the board stays on the axis.
    pub axis_tilt_deg: [f64; 2],
}

/// How the board sits on the stage; the same for all placements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mount {
    /// Distance of the board's middle from the axis, towards the rig, mm.
    pub radius_mm: f64,
    /// Rotation vector of the board against the stage, degrees.
    pub tilt_deg: [f64; 3],
}

fn rotation_deg(x: f64, y: f64, z: f64) -> Matrix3<f64> {
    so3::exp(&Vector3::new(
        x.to_radians(),
        y.to_radians(),
        z.to_radians(),
    ))
}

/// Wobble of the stage at the board's middle: standard deviations per axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wobble {
    /// Of the translation, mm.
    pub runout_mm: f64,
    /// Of the rotation, degrees.
    pub wobble_deg: f64,
}

/// Where the board is: `bench_from_board` at one dial angle of one placement.
///
/// `bench_from_stage * rotation about y * mount`, with the wobble in between, at the board's middle.
pub(super) fn bench_from_board(
    placement: &Placement,
    mount: &Mount,
    board: &BoardSpec,
    angle_deg: f64,
    wobble: &RigidTransform,
) -> RigidTransform {
    let [azimuth, elevation] = placement.look_deg;
    // Positive azimuth turns z towards x, positive elevation turns it towards -y (upwards).
    let look = rotation_deg(0.0, azimuth, 0.0) * rotation_deg(elevation, 0.0, 0.0);
    let [in_image, towards] = placement.axis_tilt_deg;
    let bench_from_stage = RigidTransform::new(
        look * rotation_deg(towards, 0.0, in_image),
        look * Vector3::new(
            placement.shift_mm[0],
            placement.shift_mm[1],
            placement.distance_mm + mount.radius_mm,
        ),
    );
    let turned = RigidTransform::new(rotation_deg(0.0, angle_deg, 0.0), Vector3::zeros());
    let stage_from_middle = RigidTransform::new(
        Matrix3::identity(),
        Vector3::new(0.0, 0.0, -mount.radius_mm),
    );
    let [tilt_x, tilt_y, tilt_z] = mount.tilt_deg;
    let tilt = RigidTransform::new(rotation_deg(tilt_x, tilt_y, tilt_z), Vector3::zeros());
    let middle_from_board = RigidTransform::new(Matrix3::identity(), -board.center_in_board());
    (bench_from_stage * turned * stage_from_middle * *wobble * tilt * middle_from_board)
        .orthonormalized()
}

/// The wobble of one pose.
pub(super) fn draw_wobble(seed: u64, pose: usize, wobble: &Wobble) -> RigidTransform {
    let mut rng = random::stream(seed, Purpose::Stage, 0, pose);
    let mut vector = |sd: f64| {
        Vector3::new(
            sd * random::normal(&mut rng),
            sd * random::normal(&mut rng),
            sd * random::normal(&mut rng),
        )
    };
    let phi = vector(wobble.wobble_deg.to_radians());
    let shift = vector(wobble.runout_mm);
    RigidTransform::new(so3::exp(&phi), shift)
}
