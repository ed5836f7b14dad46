//! The arithmetic of integers, held against that of f32 on every golden blob, and what a blob says of it.

use crate::test_blob::{AlignedBytes, repair_checksum};
use ray_runtime::format::{SelfTest, tag};
use ray_runtime::integer::{FixedPixel, Rig, Unsuited};
use ray_runtime::{LookupError, MeasureError, OpenError, PixelPoint, Ray, RayBlob};
use split_mix::SplitMix;
use std::path::Path;

fn golden() -> Vec<(String, AlignedBytes)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden");
    let mut blobs: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "rays"))
        .map(|path| {
            let bytes = std::fs::read(&path).unwrap();
            (path.display().to_string(), AlignedBytes::new(&bytes))
        })
        // Versions 1 and 2 take a feature.
        .filter(|(_, bytes)| {
            !matches!(
                RayBlob::open(bytes.bytes()),
                Err(OpenError::WrongVersion { .. })
            )
        })
        .collect();
    blobs.sort_by(|a, b| a.0.cmp(&b.0));
    assert!(blobs.len() >= 11);
    blobs
}

fn norm(v: [f32; 3]) -> f64 {
    v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
}

fn between(a: [f32; 3], b: [f32; 3]) -> f64 {
    norm([0, 1, 2].map(|k| a[k] - b[k]))
}

/// How far a ray is from another, px: of its direction, and of its origin at the working distance.
fn error_px(found: &Ray, exact: &Ray, beside: &Ray, working_distance_mm: f64) -> f64 {
    let angle = between(found.direction, exact.direction);
    let shift = between(found.origin_mm, exact.origin_mm) / working_distance_mm;
    (angle + shift) / between(beside.direction, exact.direction)
}

#[test]
fn rays_are_those_of_f32_within_a_hundredth_of_a_pixel() {
    for (name, bytes) in golden() {
        let blob = RayBlob::open(bytes.bytes()).unwrap();
        let rig = Rig::<2>::prepare(&blob).unwrap();
        let mut random = SplitMix(5);
        let mut worst_px = 0.0_f64;
        for camera in 0..2 {
            let pixels = (0..48 * 64).map(|k| PixelPoint::new((k % 64) as f32, (k / 64) as f32));
            let subpixels = (0..30_000)
                .map(|_| PixelPoint::new(random.between(-0.5, 63.5), random.between(-0.5, 47.5)));
            for pixel in pixels.chain(subpixels) {
                let (found, exact) = (rig.lookup(camera, pixel), blob.lookup(camera, pixel));
                let (Ok(found), Ok(exact)) = (found, exact) else {
                    assert_eq!(found.err(), exact.err(), "{name} {pixel:?}");
                    continue;
                };
                let step = if pixel.u > 32.0 { -0.25 } else { 0.25 };
                let Ok(beside) = blob.lookup(camera, PixelPoint::new(pixel.u + step, pixel.v))
                else {
                    continue;
                };
                let distance_mm = f64::from(blob.working_distance_mm());
                worst_px = worst_px.max(0.25 * error_px(&found, &exact, &beside, distance_mm));
            }
        }
        // Of these coarse sensors 0.0002 px are seen.
        assert!(worst_px < 0.001, "{name}: {worst_px}");
    }
}

#[test]
fn points_are_those_of_f32_and_so_are_refusals() {
    for (name, bytes) in golden() {
        let blob = RayBlob::open(bytes.bytes()).unwrap();
        let rig = Rig::<2>::prepare(&blob).unwrap();
        let mut random = SplitMix(6);
        let mut count = 0;
        for _ in 0..3000 {
            let first = PixelPoint::new(random.between(-2.0, 65.0), random.between(-2.0, 49.0));
            let depth = random.between(50.0, 3000.0);
            let second = blob.lookup(0, first).ok().and_then(|ray| {
                let seen = [0, 1, 2].map(|k| ray.origin_mm[k] + ray.direction[k] * depth);
                let start = PixelPoint::new(32.0, 24.0);
                blob.project_near(1, seen, start).ok()
            });
            let second = second.unwrap_or(PixelPoint::new(10.0, 10.0));
            let second = PixelPoint::new(
                second.u + random.between(-0.5, 0.5),
                second.v + random.between(-0.5, 0.5),
            );
            let (found, exact) = (
                rig.triangulate((0, first), (1, second)),
                blob.triangulate((0, first), (1, second)),
            );
            let (Ok(found), Ok(exact)) = (found, exact) else {
                // Rays that are no match may miss each other by much.
                let is_outside = |error| matches!(error, MeasureError::Outside { .. });
                let codes = [found.map(|_| ()), exact.map(|_| ())];
                if codes.iter().any(|code| code.is_err_and(is_outside)) {
                    assert_eq!(codes[0], codes[1], "{name} {first:?} {second:?}");
                }
                continue;
            };
            count += 1;
            // A point moves by some 5 mm a pixel at half a meter, and with the square of its distance.
            let distance_mm = norm(exact.point_mm).max(500.0);
            let allowed_mm = 0.04 * (distance_mm / 500.0).powi(2);
            let off_mm = between(found.point_mm, exact.point_mm);
            assert!(off_mm < allowed_mm, "{name}: {off_mm} at {distance_mm}");
            let gap_mm = f64::from(found.gap_mm() - exact.gap_mm()).abs();
            assert!(gap_mm < allowed_mm, "{name}: gap {gap_mm}");
        }
        assert!(count > 800, "{name}: {count}");
    }
}

#[test]
fn fixed_point_is_what_becomes_f32() {
    let (_, bytes) = golden().remove(2);
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let rig = Rig::<2>::prepare(&blob).unwrap();
    let pixel = |u: i32, v: i32| FixedPixel { u, v };
    let (a, b) = (pixel(30 << 16, 41 << 15), pixel(33 << 16, 21 << 16));
    let ray = rig.lookup_fixed(0, a).unwrap();
    assert_eq!(rig.lookup(0, PixelPoint::new(30.0, 20.5)), Ok(ray.to_ray()));
    let fixed = rig.triangulate_fixed((0, a), (1, b)).unwrap();
    let point = fixed.to_triangulation().point_mm;
    let coarse = fixed.point_in(-8).unwrap().map(|x| x as f32 / 256.0);
    // Rounded down.
    assert!(between(point, coarse) < 0.01, "{point:?} {coarse:?}");
    assert_eq!(fixed.point_in(fixed.exponent), Some(fixed.point));
    assert_eq!(fixed.point_in(-40), None);
    assert_eq!(
        rig.lookup_fixed(2, a),
        Err(LookupError::NoSuchCamera {
            camera: 2,
            count: 2
        })
    );
    assert_eq!(
        rig.lookup(0, PixelPoint::new(f32::NAN, 1.0)),
        Err(LookupError::Outside)
    );
    let same = rig.triangulate_fixed((0, a), (0, a));
    assert_eq!(same, Err(MeasureError::Parallel));
    let room = Rig::<1>::prepare(&blob).unwrap_err();
    assert_eq!(room, Unsuited::TooManyCameras { count: 2, room: 1 });
    assert_eq!(room.code(), 80);
}

#[test]
fn a_blob_states_what_integers_answer_and_no_other_content_is_one() {
    let mut count = 0;
    for (name, bytes) in golden() {
        let blob = RayBlob::open(bytes.bytes()).unwrap();
        let rig = Rig::<2>::prepare(&blob).unwrap();
        let Some(stated) = blob.arithmetic() else {
            assert_eq!(rig.run_self_tests(&blob), Ok(0));
            continue;
        };
        count += 1;
        assert!(
            stated.max_error_px > 0.0 && stated.max_error_px < 0.01,
            "{name}"
        );
        let is_asked = |test: &SelfTest| !matches!(test, SelfTest::Sigma { .. });
        let asked = blob.self_tests().filter(is_asked).count();
        assert_eq!(rig.run_self_tests(&blob), Ok(asked));

        // The section is the last: its first bytes by its tag and flags.
        let content_len = 8 + 4 * stated.answers.len();
        let start = bytes.bytes().len() - (8 + content_len).next_multiple_of(8);
        let changed = |at: usize, byte: u8| {
            let mut copy = bytes.bytes().to_vec();
            copy[start + at] = byte;
            let mut copy = AlignedBytes::new(&copy);
            repair_checksum(copy.bytes_mut());
            copy
        };
        assert_eq!(
            bytes.bytes()[start..start + 2],
            tag::ARITHMETIC.to_le_bytes()
        );
        for (at, byte) in [(8, 2), (10, 1), (15, 0xff)] {
            let refused = RayBlob::open(changed(at, byte).bytes()).map(|_| ());
            assert_eq!(refused, Err(OpenError::BadSection { section: 0 }), "{at}");
        }
        // Another answer is another one's.
        let other = changed(16, bytes.bytes()[start + 16] ^ 1);
        let blob = RayBlob::open(other.bytes()).unwrap();
        assert!(
            Rig::<2>::prepare(&blob)
                .unwrap()
                .run_self_tests(&blob)
                .is_err()
        );
    }
    assert_eq!(count, 2);
}
