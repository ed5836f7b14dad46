//! Rows against single questions, bit by bit: all golden blobs, all rows.

use ray_runtime::{
    Aligned, EpipolarRun, LookupError, Matched, MeasureError, PixelPoint, Ray, RayBlob, Row,
    RowPoint,
};

macro_rules! golden {
    ($($name:literal),*) => {
        [$((
            $name,
            &Aligned(*include_bytes!(concat!("../../../data/golden/", $name, ".rays"))) as &Aligned<[u8]>,
        )),*]
    };
}

static GOLDEN: [(&str, &Aligned<[u8]>); 11] = golden![
    "central-v3-fast",
    "central-v3-small",
    "non-central-v3-cubic",
    "non-central-v3-fast",
    "non-central-v3-small",
    "stereo-v1",
    "stereo-v2",
    "stereo-v3-fast",
    "stereo-v3-small",
    "stereo-v4-fast",
    "stereo-v4-small"
];

fn each_blob(check: impl Fn(&str, &RayBlob<'_>)) {
    for (name, bytes) in GOLDEN {
        check(name, &RayBlob::open(&bytes.0).unwrap());
    }
}

fn bits(ray: &Ray) -> [[u32; 3]; 2] {
    [ray.origin_mm, ray.direction].map(|v| v.map(f32::to_bits))
}

/// Compares a row with single lookups; how many pixels have a ray, and how many have none.
fn compare(
    blob: &RayBlob<'_>,
    camera: usize,
    row: &Row,
    rays: &mut [Ray],
    what: &str,
) -> [usize; 2] {
    rays.fill(Ray {
        origin_mm: [1.0; 3],
        direction: [2.0; 3],
    });
    blob.lookup_row(camera, row, rays).unwrap();
    let mut counts = [0; 2];
    for (k, ray) in rays.iter().enumerate() {
        let single = blob.lookup(camera, row.pixel(k));
        assert_eq!(
            bits(ray),
            bits(&single.unwrap_or(Ray::OUTSIDE)),
            "{what} {camera} {row:?} {k}"
        );
        assert_eq!(ray.is_outside(), single.is_err());
        counts[usize::from(single.is_err())] += 1;
    }
    counts
}

#[test]
fn rays_of_a_row_have_the_bits_of_single_ones() {
    each_blob(|name, blob| {
        let mut counts = [0; 2];
        for camera in 0..blob.camera_count() {
            for half_row in -3..98_i16 {
                let v = f32::from(half_row) * 0.5;
                // Whole rows over both borders, shifted by fractions; binned ones; runs within.
                for (first, step, length) in [
                    (-2.0, 1, 70),
                    (0.0, 1, 64),
                    (-0.5, 1, 66),
                    (-1.3, 1, 67),
                    (0.0, 2, 33),
                    (0.5, 4, 16),
                    (7.25, 3, 9),
                    (20.0, 1, 3),
                    (63.0, 1, 1),
                    (17.75, 0, 3),
                ] {
                    let row = Row {
                        first: PixelPoint::new(first, v),
                        step_px: step,
                    };
                    let mut rays = [Ray::OUTSIDE; 70];
                    let found = compare(blob, camera, &row, &mut rays[..length], name);
                    counts = [counts[0] + found[0], counts[1] + found[1]];
                }
            }
        }
        assert!(counts[0] > 40_000 && counts[1] > 4000, "{name} {counts:?}");
    });
}

#[test]
fn every_place_of_a_row_is_one_that_a_single_lookup_knows() {
    // 1/64 px apart: every border of every cell and of the mask.
    each_blob(|name, blob| {
        for camera in 0..blob.camera_count() {
            for v in [0.0, 12.0, 23.5, 46.75] {
                for part in 0..64_u16 {
                    let first = PixelPoint::new(f32::from(part) / 64.0 - 1.0, v);
                    let row = Row { first, step_px: 1 };
                    compare(blob, camera, &row, &mut [Ray::OUTSIDE; 66], name);
                }
            }
        }
    });
}

#[test]
fn a_row_that_is_nowhere_has_no_rays() {
    each_blob(|name, blob| {
        let numbers = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            -1e30,
            1e30,
            -1e7,
            5.0,
        ];
        for u in numbers {
            for v in numbers {
                for step_px in [0, 1, u16::MAX] {
                    let row = Row {
                        first: PixelPoint::new(u, v),
                        step_px,
                    };
                    compare(blob, 0, &row, &mut [Ray::OUTSIDE; 20], name);
                }
            }
        }
        let row = Row {
            first: PixelPoint::new(0.0, 0.0),
            step_px: 1,
        };
        let count = blob.camera_count();
        let error = LookupError::NoSuchCamera { camera: 9, count };
        assert_eq!(blob.lookup_row(9, &row, &mut []), Err(error));
        assert_eq!(blob.lookup_row(0, &row, &mut []), Ok(()));
    });
}

#[test]
fn points_of_a_row_have_the_bits_of_single_ones() {
    each_blob(|name, blob| {
        let mut counts = [0; 2];
        for v in 0..48_u8 {
            let v = f32::from(v);
            let row = Row {
                first: PixelPoint::new(-1.0, v),
                step_px: 1,
            };
            let mut random = split_mix::SplitMix(v.to_bits().into());
            let disparities: [f32; 66] = core::array::from_fn(|_| random.between(-20.0, 20.0));
            let columns: [f32; 66] = core::array::from_fn(|k| row.pixel(k).u - disparities[k]);
            let pixels = columns.map(|u| PixelPoint::new(u, v + 0.5));
            for (matched, other_v) in [
                (Matched::Disparities(v, &disparities), v),
                (Matched::Columns(v - 1.0, &columns), v - 1.0),
                (Matched::Pixels(&pixels), v + 0.5),
            ] {
                let mut points = [RowPoint::none(MeasureError::Behind); 70];
                let found = blob.triangulate_row((0, &row), (1, matched), &mut points);
                assert_eq!(found, Ok(66));
                for (k, point) in points[..66].iter().enumerate() {
                    let other = PixelPoint::new(columns[k], other_v);
                    let single = blob.triangulate((0, row.pixel(k)), (1, other));
                    let expected = match single {
                        Ok(found) => (found.point_mm.map(f32::to_bits), found.gap_squared_mm2, 0),
                        Err(error) => ([f32::NAN.to_bits(); 3], f32::NAN, error.code().into()),
                    };
                    let (point_mm, gap_squared, code) = expected;
                    assert_eq!(point.point_mm.map(f32::to_bits), point_mm, "{name} {v} {k}");
                    assert_eq!(point.gap_squared_mm2.to_bits(), gap_squared.to_bits());
                    assert_eq!(point.code, code);
                    counts[usize::from(single.is_err())] += 1;
                }
                // Nothing is written behind the last match.
                assert_eq!(points[66].code, 68);
            }
        }
        assert!(counts.iter().all(|count| *count > 300), "{name} {counts:?}");
        let row = Row {
            first: PixelPoint::new(30.0, 20.0),
            step_px: 1,
        };
        let none = Matched::Columns(20.0, &[f32::NAN]);
        let mut point = [RowPoint::none(MeasureError::Behind)];
        assert_eq!(
            blob.triangulate_row((0, &row), (1, none), &mut point),
            Ok(1)
        );
        assert_eq!(point[0].code, 64);
        assert!(
            blob.triangulate_row((0, &row), (2, none), &mut point)
                .is_err()
        );
    });
}

#[test]
fn an_epipolar_table_has_the_ends_of_what_is_seen() {
    each_blob(|name, blob| {
        let range_mm = [250.0, 2000.0];
        let mut counts = [0; 3];
        for v in [3.0, 20.0, 41.0] {
            let row = Row {
                first: PixelPoint::new(-1.0, v),
                step_px: 3,
            };
            let mut runs = [EpipolarRun::NONE; 22];
            blob.epipolar_row(0, &row, 1, range_mm, &mut runs).unwrap();
            for (k, run) in runs.iter().enumerate() {
                let pixel = row.pixel(k);
                let Ok(curve) = blob.epipolar_curve((0, pixel), 1, range_mm, 64) else {
                    assert!(run.is_none());
                    counts[0] += 1;
                    continue;
                };
                let curve: Vec<_> = curve.collect();
                let Some((first, last)) = curve.first().zip(curve.last()) else {
                    assert!(run.is_none(), "{name} {v} {k}");
                    counts[0] += 1;
                    continue;
                };
                // Newton's method ends within 1e-4 px wherever it starts.
                for (found, expected) in [(run.far, first.pixel), (run.near, last.pixel)] {
                    let off = (found.u - expected.u).hypot(found.v - expected.v);
                    assert!(off < 2e-4, "{name} {v} {k}: {off}");
                }
                counts[if curve.len() == 64 { 1 } else { 2 }] += 1;
            }
        }
        assert!(counts.iter().all(|count| *count > 0), "{name} {counts:?}");
        let row = Row {
            first: PixelPoint::new(30.0, 20.0),
            step_px: 1,
        };
        let mut run = [EpipolarRun::NONE];
        assert!(blob.epipolar_row(0, &row, 2, range_mm, &mut run).is_err());
        assert!(blob.epipolar_row(2, &row, 0, range_mm, &mut run).is_err());
        blob.epipolar_row(0, &row, 1, [0.0, 100.0], &mut run)
            .unwrap();
        assert!(run[0].is_none());
    });
}

#[test]
fn holes_in_the_mask_have_no_rays() {
    // The calibrated area of the first camera, 48 x 36 cells of 4/3 px, with every bit drawn anew.
    for (name, bytes) in GOLDEN {
        let mask = usize::try_from(first_mask(bytes)).unwrap();
        let mut words = vec![0_u64; bytes.0.len() / 8];
        let changed: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
        changed.copy_from_slice(&bytes.0);
        let mut random = split_mix::SplitMix(3);
        for byte in &mut changed[mask..mask + 216] {
            // Three of four bits, so that there are runs.
            *byte = (random.next() | random.next()) as u8;
        }
        let crc = ray_runtime::format::checksum(changed).unwrap();
        changed[12..16].copy_from_slice(&crc.to_le_bytes());
        let blob = RayBlob::open(changed).unwrap();
        let mut counts = [0; 2];
        for v in 0..48_u8 {
            for (u, step_px) in [(0.0, 1), (-0.25, 1), (0.5, 2)] {
                let row = Row {
                    first: PixelPoint::new(u, v.into()),
                    step_px,
                };
                let found = compare(&blob, 0, &row, &mut [Ray::OUTSIDE; 64], name);
                counts = [counts[0] + found[0], counts[1] + found[1]];
            }
        }
        assert!(
            counts.iter().all(|count| *count > 1000),
            "{name} {counts:?}"
        );
    }
}

/// Where the first camera's mask starts in a golden blob: word 6 of its record.
fn first_mask(bytes: &Aligned<[u8]>) -> u32 {
    let word = |at: usize| u32::from_le_bytes(bytes.0[at..at + 4].try_into().unwrap());
    let records = ray_runtime::format::aligned(24 + word(16) as usize);
    word(records + 24)
}
