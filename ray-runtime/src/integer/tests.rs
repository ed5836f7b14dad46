//! Held against the f32 path.

extern crate std;

use super::*;
use crate::{Aligned, PixelPoint, RayBlob};
use split_mix::SplitMix;
use std::println;

macro_rules! golden {
    ($($name:literal),*) => {
        [$(($name, &Aligned(*include_bytes!(concat!("../../../data/golden/", $name, ".rays"))) as &Aligned<[u8]>)),*]
    };
}

#[test]
fn rays_are_those_of_f32_within_a_hundredth_of_a_pixel() {
    for (name, bytes) in golden!(
        "central-v3-fast", "central-v3-small", "non-central-v3-cubic", "non-central-v3-fast",
        "non-central-v3-small", "stereo-v3-fast", "stereo-v3-small", "stereo-v4-fast", "stereo-v4-small",
        "stereo-v1", "stereo-v2"
    ) {
        let Ok(blob) = RayBlob::open(&bytes.0) else { continue };
        let rig = Rig::<2>::prepare(&blob).unwrap();
        let mut random = SplitMix(5);
        let (mut worst, mut worst_mm) = (0.0f64, 0.0f64);
        for camera in 0..2 {
            for k in 0..20_000 {
                let pixel = PixelPoint::new(random.unit() * 64.0 - 0.5, random.unit() * 48.0 - 0.5);
                let (a, b) = (rig.lookup(camera, pixel), blob.lookup(camera, pixel));
                let (Ok(a), Ok(b)) = (a, b) else {
                    assert_eq!(a.is_ok(), b.is_ok(), "{name} {camera} {pixel:?}");
                    continue;
                };
                let _ = k;
                worst = worst.max(f64::from((a.direction - b.direction).norm()));
                worst_mm = worst_mm.max(f64::from((a.origin_mm - b.origin_mm).norm()));
            }
        }
        let (mut point, mut gap, mut count) = (0.0f64, 0.0f64, 0);
        for _ in 0..20_000 {
            let mut pixel = || PixelPoint::new(random.unit() * 64.0 - 0.5, random.unit() * 48.0 - 0.5);
            let p = pixel();
            let Ok(ray) = blob.lookup(0, p) else { continue };
            let seen = ray.origin_mm + ray.direction * random.between(50.0, 3000.0);
            let Ok(q) = blob.project_near(1, &seen, PixelPoint::new(32.0, 24.0)) else { continue };
            let q = PixelPoint::new(q.u + random.between(-0.5, 0.5), q.v + random.between(-0.5, 0.5));
            count += 1;
            match (rig.triangulate((0, p), (1, q)), blob.triangulate((0, p), (1, q))) {
                (Ok(a), Ok(b)) => {
                    let scale = f64::from(b.point_mm.norm()).max(500.0).powi(2) / 250_000.0;
                    point = point.max(f64::from((a.point_mm - b.point_mm).norm()) / scale);
                    gap = gap.max(f64::from((a.gap_mm() - b.gap_mm()).abs()) / scale);
                }
                (a, b) => assert_eq!(a.is_ok(), b.is_ok(), "{name} {p:?} {q:?} {a:?} {b:?}"),
            }
        }
        println!("{name}: direction {worst:.2e}, origin {worst_mm:.2e} mm, point {point:.2e} mm, gap {gap:.2e} mm of {count}; rig {}", size_of::<Rig<'_, 2>>());
    }
}
