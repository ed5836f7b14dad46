//! Whatever opens must answer, with finite numbers, and nothing may panic.
//!
//! The input is a blob with the checksum, and in most inputs the length, put right, so that damage gets
//! past them: without that, no mutation would.

#![no_main]

use libfuzzer_sys::fuzz_target;
use ray_runtime::format::{CRC_OFFSET, Form, checksum};
use ray_runtime::{
    Camera, MatchNoise, PixelPoint, PointCovariance, RayBlob, Readout, SensorWindow,
};

/// Longest input that is looked at, bytes.
const MAX_LEN: usize = 1 << 16;

fuzz_target!(|input: &[u8]| {
    if input.len() > MAX_LEN {
        return;
    }
    // As it came; only a slice on a multiple of 8 gets far.
    let _ = RayBlob::stated_len(input);
    let _ = RayBlob::open(input);

    let mut words = vec![0u64; input.len().div_ceil(8)];
    for (word, bytes) in words.iter_mut().zip(input.chunks(8)) {
        let mut padded = [0; 8];
        padded[..bytes.len()].copy_from_slice(bytes);
        *word = u64::from_le_bytes(padded);
    }
    repair(&mut words);
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    // The same bytes on an address that is a multiple of 8.
    let mut aligned = bytes.clone();
    aligned.extend([0; 8]);
    let start = aligned.as_ptr().align_offset(8);
    aligned.copy_within(..bytes.len(), start);
    if let Ok(blob) = RayBlob::open(&aligned[start..start + bytes.len()]) {
        ask_everything(&blob);
    }
});

/// Puts length and checksum right, unless the stated length says that it is to be judged.
fn repair(words: &mut [u64]) {
    let length = 8 * words.len() as u32;
    let Some(second) = words.get_mut(1) else {
        return;
    };
    const LEFT_ALONE: u32 = u32::MAX;
    if *second as u32 != LEFT_ALONE {
        *second = *second >> 32 << 32 | u64::from(length);
    }
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    if let Some(sum) = checksum(&bytes) {
        assert_eq!(CRC_OFFSET, 12, "the upper half of the second word");
        words[1] = u64::from(words[1] as u32) | u64::from(sum) << 32;
    }
}

fn ask_everything(blob: &RayBlob<'_>) {
    let count = blob.camera_count();
    assert!((1..=64).contains(&count));
    let mut seen = Vec::new();
    for index in 0..count {
        let camera = blob.camera(index).expect("it is below the count");
        assert_eq!(blob.camera_index(camera.name), Some(index));
        let region = camera.region;
        ask_window(&camera);
        let edges = |first: u32, extent: u32| {
            let (low, high) = (first as f32 - 0.5, (first + extent) as f32 - 0.5);
            [
                low,
                low + 0.25,
                (low + high) / 2.0,
                high - 0.25,
                high,
                high + 1.0,
                f32::NAN,
            ]
        };
        for u in edges(region.u, region.width) {
            for v in edges(region.v, region.height) {
                let pixel = PixelPoint::new(u, v);
                let ray = blob.lookup(index, pixel);
                assert_eq!(ray.is_ok(), blob.is_calibrated(index, pixel));
                if let Ok(ray) = ray {
                    // A polynomial of degree 9 with coefficients of a million stays far below the
                    // largest number; only its products need not.
                    let is_small = camera.encoding.form == Form::Spline;
                    assert!(!is_small || ray.direction.iter().all(|x| x.is_finite()));
                    seen.push((index, pixel));
                }
            }
        }
    }
    assert!(blob.lookup(count, PixelPoint::new(0.0, 0.0)).is_err());
    seen.truncate(40);
    for (k, &a) in seen.iter().enumerate() {
        let b = seen[(k * 7 + 1) % seen.len()];
        let point = blob.triangulate(a, b);
        let measured = blob.triangulate_with_covariance(a, b);
        assert_eq!(point.is_ok(), measured.is_ok());
        if let (Ok(point), Ok(measured)) = (point, measured) {
            let bits = |x: [f32; 3]| x.map(f32::to_bits);
            assert_eq!(bits(point.point_mm), bits(measured.found.point_mm));
            let _ = measured.covariance.map(|covariance| covariance.sigma_mm());
            // What a request says of the noise in place of the blob: the same bits if it says the same.
            if let Some(noise) = blob.match_noise() {
                let asked = blob.triangulate_with_noise(a, b, noise);
                let sigma = |found: Option<PointCovariance>| found.map(|c| bits(c.sigma_mm()));
                assert_eq!(
                    sigma(asked.ok().and_then(|m| m.covariance)),
                    sigma(measured.covariance)
                );
            }
            let _ = blob.triangulate_with_noise(a, b, MatchNoise::NONE);
            // Twice at most: a projection costs as much as a hundred points.
            if k % 32 == 0 {
                ask_back(blob, a, b.0, point.point_mm);
            }
        }
    }
    let _ = blob.triangulate_many(&seen[..seen.len().min(5)]);
    let _ = blob.uncertain_pairs().count();
    let _ = blob.run_self_tests();
    let _ = (blob.identity(), blob.frame(), blob.written_by(), blob.len());
}

/// Where another camera sees a point, and a pixel's ray.
fn ask_back(blob: &RayBlob<'_>, seen: (usize, PixelPoint), other: usize, point_mm: [f32; 3]) {
    if let Ok(pixel) = blob.project(other, point_mm) {
        assert!(blob.is_calibrated(other, pixel));
        // One step from where the last one was too short to matter: found or lost, but no panic.
        let _ = blob.project_near(other, point_mm, pixel);
    }
    let curve = blob.epipolar_curve(seen, other, [50.0, 5000.0], 4);
    let curve = curve.expect("both were looked up");
    for point in curve {
        assert!(blob.is_calibrated(other, point.pixel));
    }
}

/// The half of a sensor behind its middle, pixels joined by two.
fn ask_window(camera: &Camera<'_>) {
    let sensor = [camera.sensor_width, camera.sensor_height];
    let readout = Readout {
        sensor,
        first: sensor.map(|extent| extent / 2),
        image: sensor.map(|extent| (extent / 4).max(1)),
        binning: [2, 2],
    };
    if let Ok(window) = SensorWindow::new(camera, &readout) {
        let sensor = window.to_sensor(PixelPoint::new(0.0, 0.0));
        assert!(sensor.u >= 0.0 && sensor.v >= 0.0);
    }
}
