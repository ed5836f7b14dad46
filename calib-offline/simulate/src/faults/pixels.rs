//! Corners whose pixels were written down in another convention.

use super::recording::Recording;
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::View;

/// Writes the pixels of some views as `told` says.
fn rewrite(
    recording: &mut Recording,
    is_one: impl Fn(&View) -> bool,
    told: impl Fn(PixelPoint) -> PixelPoint,
) {
    for view in recording.views.iter_mut().filter(|view| is_one(view)) {
        for corner in &mut view.corners {
            corner.pixel = told(corner.pixel);
        }
    }
}

/// (0, 0) is the outer edge of the first pixel and not its center.
pub(super) fn count_from_the_edge(recording: &mut Recording, is_one: impl Fn(&View) -> bool) {
    rewrite(recording, is_one, |pixel| {
        PixelPoint::new(pixel.u + 0.5, pixel.v + 0.5)
    });
}

/// v counts from the last line upwards.
pub(super) fn count_upwards(recording: &mut Recording, is_one: impl Fn(&View) -> bool) {
    let last = f64::from(recording.sensors[0].height - 1);
    rewrite(recording, is_one, |pixel| {
        PixelPoint::new(pixel.u, last - pixel.v)
    });
}

/// u and v exchanged, as an array's row and column are.
pub(super) fn exchange_axes(recording: &mut Recording) {
    rewrite(
        recording,
        |_| true,
        |pixel| PixelPoint::new(pixel.v, pixel.u),
    );
}
