//! Every kind of optics against identities that hold exactly.

use super::*;
use crate::simulate::preset::{OpticsKind, rig};

const SENSOR: SensorSize = SensorSize::new(1280, 1024);

#[test]
fn the_point_on_a_pixels_ray_is_seen_by_that_pixel() {
    for kind in OpticsKind::ALL {
        for camera in &rig(kind, SENSOR).cameras {
            let mut seen = 0;
            for step in 0..200 {
                // A rank-1 lattice: even over the sensor, aligned with nothing.
                let pixel = PixelPoint::new(
                    f64::from(camera.sensor().width) * (f64::from(step) * 0.618_034).fract(),
                    f64::from(camera.sensor().height) * (f64::from(step) + 0.5) / 200.0 - 0.5,
                );
                let Some(ray) = camera.ray(pixel) else {
                    continue;
                };
                for distance_mm in [180.0, 350.0, 900.0] {
                    let point = ray.origin_mm + ray.direction * distance_mm;
                    let found = camera.project_unclipped(&point).unwrap();
                    let error = found.distance_px(pixel);
                    assert!(error < 1e-9, "{kind:?} {pixel:?}: {error} px");
                }
                seen += 1;
            }
            assert!(seen > 100, "{kind:?}: only {seen} of 200 pixels have a ray");
        }
    }
}
