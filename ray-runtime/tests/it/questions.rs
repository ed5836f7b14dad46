//! Rays and points out of blobs whose answers can be computed by hand.

use crate::test_blob::{TestBlob, TestCamera, encoding};
use nalgebra::Vector3;
use ray_runtime::format::{Form, SelfTest};
use ray_runtime::{
    LookupError, MeasureError, PixelPoint, RayBlob, SelfTestFailure, triangulate_pair,
};
use split_mix::SplitMix;

const FORMS: [Form; 3] = [Form::Spline, Form::Patches, Form::Quantized];

/// Looks back at the first camera's side: x and z turned around.
const TURNED: [f32; 9] = [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0];

#[test]
fn the_center_of_the_sensor_looks_straight_ahead() {
    let bytes = TestBlob::new(vec![TestCamera::new("a", 7.0)]).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let ray = blob.lookup(0, PixelPoint::new(31.5, 23.5)).unwrap();
    assert_eq!(ray.origin_mm, [7.0, 0.0, 0.0]);
    assert!((Vector3::from(ray.direction) - Vector3::z()).norm() < 1e-7);
}

#[test]
fn every_pixel_of_a_linear_field_has_its_direction() {
    FORMS.into_iter().for_each(every_pixel_has_its_direction);
}

fn every_pixel_has_its_direction(form: Form) {
    let mut camera = TestCamera::new("a", 0.0);
    camera.encoding = encoding(form, true);
    let bytes = TestBlob::new(vec![camera.clone()]).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    for v in 0..=96 {
        for u in 0..=128 {
            let (u, v) = (u as f32 / 2.0 - 0.5, v as f32 / 2.0 - 0.5);
            let [s1, s2] = camera.s(u, v);
            let expected = Vector3::new(s1, s2, 1.0 - (s1 * s1 + s2 * s2) / 4.0);
            let ray = blob.lookup(0, PixelPoint::new(u, v)).unwrap();
            assert!(
                (Vector3::from(ray.direction) - expected).norm() < camera.round_off(),
                "{u} {v}"
            );
            assert_eq!(ray.origin_mm, [0.0; 3]);
        }
    }
}

#[test]
fn an_offset_moves_the_ray_across_itself_and_turns_with_the_camera() {
    FORMS.into_iter().for_each(an_offset_moves_the_ray);
}

fn an_offset_moves_the_ray(form: Form) {
    let mut camera = TestCamera::new("a", 100.0);
    camera.encoding = encoding(form, false);
    camera.offset_mm = [3.0, 4.0];
    camera.rotation = TURNED;
    let bytes = TestBlob::new(vec![camera.clone()]).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    assert!(!blob.camera(0).unwrap().encoding.is_central);

    let center = blob.lookup(0, PixelPoint::new(31.5, 23.5)).unwrap();
    let [origin, direction] = [center.origin_mm, center.direction].map(Vector3::from);
    assert!((origin - Vector3::new(97.0, 4.0, 0.0)).norm() < 1e-5);
    assert!((direction + Vector3::z()).norm() < 1e-6);

    for (u, v) in [(0.0, 0.0), (63.0, 10.0), (20.25, 47.0)] {
        let ray = blob.lookup(0, PixelPoint::new(u, v)).unwrap();
        let [origin, direction] = [ray.origin_mm, ray.direction].map(Vector3::from);
        let offset = origin - Vector3::new(100.0, 0.0, 0.0);
        let [s1, s2] = camera.s(u, v);
        // The grid holds m / (1 + s.s/4), so |m| is 5 times that; and it is across the ray.
        let length = 5.0 * (1.0 + (s1 * s1 + s2 * s2) / 4.0);
        assert!((offset.norm() - length).abs() < 2e-5);
        assert!(offset.dot(&direction).abs() < 2e-5 * direction.norm());
    }
}

#[test]
fn outside_is_said_and_never_extrapolated() {
    let mut camera = TestCamera::new("a", 0.0);
    // Cells of 16 x 16 px; the middle one of the top row is not calibrated.
    camera.mask[1] = false;
    let bytes = TestBlob::new(vec![camera]).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let outside = [
        (-0.6, 5.0),
        (63.6, 5.0),
        (5.0, -0.6),
        (5.0, 47.6),
        (15.5, 0.0),
        (31.0, 15.0),
        (f32::NAN, 5.0),
        (5.0, f32::NAN),
        (f32::INFINITY, 5.0),
        (f32::NEG_INFINITY, 5.0),
        (5.0, f32::INFINITY),
        (f32::MAX, f32::MIN),
    ];
    for (u, v) in outside {
        let pixel = PixelPoint::new(u, v);
        assert_eq!(blob.lookup(0, pixel), Err(LookupError::Outside), "{u} {v}");
        assert!(!blob.is_calibrated(0, pixel));
    }
    for (u, v) in [
        (-0.5, -0.5),
        (63.5, 47.5),
        (15.4, 0.0),
        (31.5, 15.0),
        (31.0, 15.5),
    ] {
        let pixel = PixelPoint::new(u, v);
        assert!(
            blob.lookup(0, pixel).is_ok() && blob.is_calibrated(0, pixel),
            "{u} {v}"
        );
    }
}

#[test]
fn a_region_keeps_the_pixel_coordinates_of_the_sensor() {
    let whole = TestCamera::new("whole", 0.0);
    let mut part = whole.clone();
    part.name = "part";
    part.region = [20, 10, 30, 25];
    let bytes = TestBlob::new(vec![whole, part]).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let pixel = PixelPoint::new(33.0, 21.0);
    let (a, b) = (
        blob.lookup(0, pixel).unwrap(),
        blob.lookup(1, pixel).unwrap(),
    );
    let [a, b] = [a, b].map(|ray| Vector3::from(ray.direction));
    assert!((a - b).norm() < 3e-7);
    assert!(blob.is_calibrated(1, PixelPoint::new(19.5, 9.5)));
    assert!(!blob.is_calibrated(1, PixelPoint::new(19.4, 9.5)));
    assert!(blob.is_calibrated(1, PixelPoint::new(49.5, 34.5)));
    assert!(!blob.is_calibrated(1, PixelPoint::new(49.6, 34.5)));
}

#[test]
fn a_camera_that_is_not_there_is_named() {
    let bytes = TestBlob::new(vec![TestCamera::new("a", 0.0)]).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let pixel = PixelPoint::new(1.0, 1.0);
    assert_eq!(
        blob.lookup(1, pixel),
        Err(LookupError::NoSuchCamera {
            camera: 1,
            count: 1
        })
    );
    assert_eq!(
        blob.triangulate((0, pixel), (7, pixel)),
        Err(MeasureError::NoSuchCamera {
            camera: 7,
            count: 1
        })
    );
    assert!(blob.camera(1).is_none());
    assert_eq!(blob.camera_index("a"), Some(0));
    assert_eq!(blob.camera_index("b"), None);
}

#[test]
fn two_cameras_meet_where_their_rays_cross() {
    // s = +-0.2 is 2 atan(0.1) off axis: tan = 0.2 / 0.99, so 100 mm apart they meet at 247.5 mm.
    let bytes = TestBlob::new(vec![
        TestCamera::new("a", -50.0),
        TestCamera::new("b", 50.0),
    ])
    .bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let (a, b) = (PixelPoint::new(41.5, 23.5), PixelPoint::new(21.5, 23.5));
    let result = blob.triangulate((0, a), (1, b)).unwrap();
    assert!((Vector3::from(result.point_mm) - Vector3::new(0.0, 0.0, 247.5)).norm() < 5e-4);
    assert!(result.gap_mm() < 1e-4);

    let many = blob.triangulate_many(&[(0, a), (1, b)]).unwrap();
    assert_eq!(many, result);
    let rays = (blob.lookup(0, a).unwrap(), blob.lookup(1, b).unwrap());
    assert_eq!(triangulate_pair(&rays.0, &rays.1), Ok(result));

    // The same pixels swapped look apart; equal pixels look parallel.
    assert_eq!(blob.triangulate((0, b), (1, a)), Err(MeasureError::Behind));
    assert_eq!(
        blob.triangulate((0, a), (1, a)),
        Err(MeasureError::Parallel)
    );
    let off = PixelPoint::new(-3.0, 0.0);
    assert_eq!(
        blob.triangulate((0, a), (1, off)),
        Err(MeasureError::Outside { camera: 1 })
    );
    assert_eq!(
        blob.triangulate_many(&[(0, a)]),
        Err(MeasureError::TooFewRays { have: 1 })
    );
}

#[test]
fn four_cameras_around_a_point_find_it() {
    let mut cameras: Vec<_> = ["a", "b", "c", "d"]
        .into_iter()
        .zip([-60.0, 60.0, 20.0, -10.0])
        .map(|(name, x)| TestCamera::new(name, x))
        .collect();
    // One stands behind the scene and looks back.
    cameras[3].rotation = TURNED;
    cameras[3].translation_mm = [0.0, 0.0, 600.0];
    let bytes = TestBlob::new(cameras.clone()).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let mut random = SplitMix(7);
    for _ in 0..500 {
        let target = Vector3::new(
            random.between(-40.0, 40.0),
            random.between(-40.0, 40.0),
            random.between(200.0, 320.0),
        );
        let sightings: Vec<_> = cameras
            .iter()
            .enumerate()
            .map(|(k, camera)| {
                let local = target - Vector3::from(camera.translation_mm);
                let turn = nalgebra::Matrix3::from_row_slice(&camera.rotation);
                let local = turn.transpose() * local;
                let s = local.xy() * (2.0 / (local.norm() + local.z));
                let pixel = s * camera.focal_px;
                (k, PixelPoint::new(pixel.x + 31.5, pixel.y + 23.5))
            })
            .collect();
        let result = blob.triangulate_many(&sightings).unwrap();
        // Pixels of up to 64 in f32 (4e-6 px) at 50 px per unit and 300 mm: 2e-5 mm across, and
        // a few times that along.
        let point = Vector3::from(result.point_mm);
        assert!((point - target).norm() < 3e-4, "{target} {result:?}");
        assert!(result.gap_mm() < 3e-4);
        // The order of the cameras does not matter beyond round-off.
        let reversed: Vec<_> = sightings.iter().rev().copied().collect();
        let other = blob.triangulate_many(&reversed).unwrap();
        assert!((point - Vector3::from(other.point_mm)).norm() < 3e-4);
    }
}

#[test]
fn self_tests_pass_as_written_and_fail_when_a_bit_differs() {
    let mut content = TestBlob::new(vec![
        TestCamera::new("a", -50.0),
        TestCamera::new("b", 50.0),
    ]);
    let (a, b) = (PixelPoint::new(41.5, 23.5), PixelPoint::new(21.5, 23.5));
    let bytes = content.bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    assert_eq!(blob.run_self_tests(), Ok(0));
    let ray = blob.lookup(1, b).unwrap();
    let result = blob.triangulate((0, a), (1, b)).unwrap();
    let good_ray = SelfTest::Ray {
        camera: 1,
        pixel: [b.u, b.v],
        origin_mm: ray.origin_mm,
        direction: ray.direction,
    };
    let pair = |gap_squared_mm2| SelfTest::Pair {
        cameras: [0, 1],
        pixels: [[a.u, a.v], [b.u, b.v]],
        point_mm: result.point_mm,
        gap_squared_mm2,
    };
    let gap = result.gap_squared_mm2;
    content.self_tests = vec![good_ray, pair(gap)];
    let bytes = content.bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    assert_eq!(blob.run_self_tests(), Ok(2));
    assert!(blob.self_tests().eq([good_ray, pair(gap)]));

    content.self_tests[1] = pair(f32::from_bits(gap.to_bits() ^ 1));
    let bytes = content.bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    assert_eq!(blob.run_self_tests(), Err(SelfTestFailure { test: 1 }));
}
