//! Pixels in another convention, or badly found.

use super::fault::{Fault, Step, fault, half_way, unseen};
use super::recording::Recording;
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::View;

pub(super) const FAULTS: &[Fault] = &[
    // Another principal point shows the same.
    unseen(
        "origin-right-all",
        &["pixel-origin"],
        Step::Written(|written, _| count_from_edge(written, |view| view.camera_idx == 1)),
    ),
    // Which half has the other convention, the corners cannot say.
    half_way(
        "origin-right-half",
        &["pixel-origin"],
        Step::Written(|written, _| {
            let half = written.pose_count() / 2;
            count_from_edge(written, |view| view.camera_idx == 1 && view.pose < half);
        }),
    ),
    fault(
        "v-upwards-both",
        &["v-upwards"],
        Step::Written(|written, _| count_upwards(written, |_| true)),
    ),
    fault(
        "v-upwards-right",
        &["v-upwards"],
        Step::Written(|written, _| count_upwards(written, |view| view.camera_idx == 1)),
    ),
    fault(
        "uv-exchanged",
        &["uv-exchanged"],
        Step::Written(|written, _| {
            rewrite(written, |_| true, |pixel| PixelPoint::new(pixel.v, pixel.u));
        }),
    ),
    fault(
        "noise-1px",
        &["noise"],
        Step::Scene(|settings| settings.noise_px = 1.0),
    ),
    fault(
        "outliers",
        &["outliers"],
        Step::Scene(|settings| settings.outlier_share = 0.08),
    ),
];

/// Writes the pixels of some views as `told` says.
fn rewrite(
    written: &mut Recording,
    is_one: impl Fn(&View) -> bool,
    told: impl Fn(PixelPoint) -> PixelPoint,
) {
    for view in written.views.iter_mut().filter(|view| is_one(view)) {
        for corner in &mut view.corners {
            corner.pixel = told(corner.pixel);
        }
    }
}

/// Makes (0, 0) the outer corner of the first pixel instead of its center.
fn count_from_edge(written: &mut Recording, is_one: impl Fn(&View) -> bool) {
    rewrite(written, is_one, |pixel| {
        PixelPoint::new(pixel.u + 0.5, pixel.v + 0.5)
    });
}

/// Counts v from the last line upwards.
fn count_upwards(written: &mut Recording, is_one: impl Fn(&View) -> bool) {
    let last = f64::from(written.sensors[0].height - 1);
    rewrite(written, is_one, |pixel| {
        PixelPoint::new(pixel.u, last - pixel.v)
    });
}
