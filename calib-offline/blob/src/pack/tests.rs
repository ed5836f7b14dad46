//! Rigs to pack, and what must hold of the blobs.

use super::proof::Rays;
use super::*;
use calib_rays::field::spline::{Spline, SplineGrid};
use calib_rays::field::{
    BaseLens, CalibratedCamera, CoverageMask, Projection, RayField, Rig, SmoothMap,
};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use calib_rays::progress::Silent;
use nalgebra::{Vector2, Vector3};
use ray_runtime::{OpenError, RayBlob};

const SENSOR: SensorSize = SensorSize::new(1280, 1024);
/// A sixteenth of the pixels, for what does not depend on their number.
const SMALL: SensorSize = SensorSize::new(320, 256);

/// A camera on the x axis of the rig that looks at the origin from `distance_mm`.
fn toed_in(x_mm: f64, distance_mm: f64) -> RigidTransform {
    let yaw = so3::exp(&Vector3::new(0.0, -(x_mm / distance_mm).atan(), 0.0));
    let translation = Vector3::new(x_mm, 3.0, -distance_mm);
    RigidTransform::new(yaw * so3::exp(&Vector3::new(0.02, 0.0, 0.01)), translation)
}

pub fn camera(name: &str, field: RayField, rig_from_camera: RigidTransform) -> CalibratedCamera {
    CalibratedCamera {
        name: name.into(),
        coverage: CoverageMask::uniform(field.sensor, true),
        field,
        rig_from_camera,
    }
}

/// A perspective lens with radial and tangential distortion of some tens of pixels.
fn distorted_field(sensor: SensorSize, focal_px: f64) -> RayField {
    let base = BaseLens::ideal(Projection::Perspective, focal_px);
    let mut field = RayField::ideal(sensor, base, 7);
    let coefficients = &mut field.direction.polynomial.coefficients;
    for (k, c) in coefficients.iter_mut().enumerate() {
        // Falls by the total degree as the terms of a lens do.
        let total = ((8.0 * k as f64 + 1.0).sqrt() as i32 - 1) / 2;
        let scale = 0.02 * 0.35f64.powi(total);
        *c = Vector2::new((k as f64 * 2.3).sin(), (k as f64 * 1.1).cos()) * scale;
    }
    field
}

/// Smooth and central.
pub fn smooth_camera() -> CalibratedCamera {
    camera(
        "left",
        distorted_field(SENSOR, 1400.0),
        toed_in(-100.0, 600.0),
    )
}

/// Central, with local bumps of a pixel on a grid of 48 px.
pub fn bumpy_camera() -> CalibratedCamera {
    let mut field = distorted_field(SENSOR, 1400.0);
    let mut spline = Spline::zero(SplineGrid::with_spacing(SENSOR, 48.0));
    for (k, c) in spline.coefficients.iter_mut().enumerate() {
        *c = Vector2::new((k as f64 * 1.7).sin(), (k as f64 * 0.9).cos()) / 1400.0;
    }
    field.direction.spline = Some(spline);
    camera("bumps", field, toed_in(100.0, 600.0))
}

/// Not central, as behind a flat port: offsets of some mm that grow towards the edge.
pub fn port_camera() -> CalibratedCamera {
    let mut field = distorted_field(SENSOR, 1500.0);
    let mut offset = SmoothMap::zero(3);
    for (k, c) in offset.polynomial.coefficients.iter_mut().enumerate() {
        *c = Vector2::new((k as f64 + 0.5).cos(), (k as f64 * 0.7).sin()) * 2.0;
    }
    field.offset = Some(offset);
    camera("port", field, toed_in(110.0, 600.0))
}

/// A camera without splines and its lens, on a sensor with a quarter of the pixels along each side.
fn on_small_sensor(mut camera: CalibratedCamera) -> CalibratedCamera {
    assert_eq!(camera.field.sensor, SENSOR);
    camera.field.sensor = SMALL;
    camera.field.base.focal_px /= 4.0;
    camera.coverage = CoverageMask::uniform(SMALL, true);
    camera
}

/// 104 degrees to either side, calibrated inside the image circle only; in the corners outside
/// the field goes on to where directions can no longer be packed.
pub fn fisheye_camera() -> CalibratedCamera {
    let base = BaseLens::ideal(Projection::Equidistant, 330.0);
    let mut field = RayField::ideal(SENSOR, base, 7);
    let last = field.direction.polynomial.coefficients.len() - 1;
    field.direction.polynomial.coefficients[last] = Vector2::new(0.0, 2e-3);
    field.direction.polynomial.coefficients[last - 3] = Vector2::new(1e-3, 0.0);
    let mut fisheye = camera("fisheye", field, toed_in(50.0, 300.0));
    let circle = (0..90).map(|k| {
        let angle = f64::from(k) * 4f64.to_radians();
        PixelPoint::new(639.5 + 600.0 * angle.cos(), 511.5 + 505.0 * angle.sin())
    });
    fisheye.coverage = CoverageMask::from_corners(SENSOR, circle);
    fisheye
}

pub fn rig(cameras: Vec<CalibratedCamera>) -> Rig {
    Rig {
        uncertainty: Vec::new(),
        cameras,
        datum_pose: 0,
        frame_is_known: false,
        match_noise_px: None,
    }
}

pub fn settings(max_error_px: f64) -> PackSettings {
    PackSettings {
        max_error_px,
        working_distance_mm: 600.0,
        identity: *b"0123456789abcdef",
        ..PackSettings::default()
    }
}

/// Packs one camera and opens the blob.
fn packed_alone(camera: CalibratedCamera, max_error_px: f64) -> (Packed, AlignedBytes) {
    packed_for(Prefer::Size, camera, max_error_px)
}

fn packed_for(
    prefer: Prefer,
    camera: CalibratedCamera,
    max_error_px: f64,
) -> (Packed, AlignedBytes) {
    let settings = PackSettings {
        prefer,
        ..settings(max_error_px)
    };
    let packed = pack(&rig(vec![camera]), &settings).unwrap();
    let bytes = AlignedBytes::from(packed.bytes.as_slice());
    (packed, bytes)
}

fn device(pixel: PixelPoint) -> ray_runtime::PixelPoint {
    ray_runtime::PixelPoint::new(pixel.u as f32, pixel.v as f32)
}

#[test]
fn every_kind_of_lens_holds_the_bound_and_says_so_in_the_blob() {
    let lenses = [
        smooth_camera(),
        bumpy_camera(),
        port_camera(),
        fisheye_camera(),
    ];
    for camera in lenses {
        for max_error_px in [0.01, 0.001] {
            let covered = camera.coverage.clone();
            for prefer in [Prefer::Size, Prefer::Speed] {
                let (packed, bytes) = packed_for(prefer, camera.clone(), max_error_px);
                let name = &camera.name;
                assert!(packed.worst_error_px <= max_error_px, "{name}");
                let blob = RayBlob::open(&bytes).unwrap();
                let stated = f64::from(blob.max_error_px());
                assert!(stated >= packed.worst_error_px && stated <= max_error_px * 1.000001);
                let pixels = (0..SENSOR.height)
                    .flat_map(|v| (0..SENSOR.width).map(move |u| (f64::from(u), f64::from(v))));
                let calibrated = pixels.filter(|(u, v)| covered.contains(PixelPoint::new(*u, *v)));
                // Those along the edge besides.
                assert!(
                    packed.tables[0].proof.pixel_count > calibrated.count(),
                    "{name}"
                );
                assert_eq!(
                    blob.camera(0).unwrap().encoding.is_central,
                    camera.field.is_central()
                );
            }
        }
    }
}

#[test]
fn a_looser_bound_costs_fewer_bytes() {
    let sizes = [0.03, 0.01, 0.001].map(|e| {
        packed_alone(on_small_sensor(port_camera()), e)
            .0
            .bytes
            .len()
    });
    assert!(sizes[0] < sizes[1] && sizes[1] < sizes[2], "{sizes:?}");
}

#[test]
fn local_bumps_are_packed_on_their_own_grid() {
    let camera = bumpy_camera();
    let own = camera.field.direction.spline.as_ref().unwrap().grid;
    let (packed, _) = packed_alone(camera, 0.01);
    let expected = [own.cells_u as u32, own.cells_v as u32];
    assert_eq!(packed.tables[0].cells, expected);
    // Exact but for the step of the knots, where other sizes of their form are off by more.
    let tried = &packed.tables[0].tried;
    let smaller = tried
        .iter()
        .filter(|t| t.cells != [1, 1] && t.cells < expected);
    assert!(smaller.clone().count() > 0);
    assert!(smaller.clone().all(|t| t.error_px > 0.01), "{tried:?}");
}

/// A polynomial of high degree takes coefficients there that the runtime refuses; other tables hold the bound.
#[test]
fn a_small_calibrated_area_far_from_the_middle_is_packed() {
    let mut camera = bumpy_camera();
    let mask = &mut camera.coverage;
    for (cell, covered) in mask.covered.iter_mut().enumerate() {
        let (i, j) = (cell % mask.cells_u, cell / mask.cells_u);
        *covered =
            (i as f64) < 0.15 * mask.cells_u as f64 && (j as f64) < 0.15 * mask.cells_v as f64;
    }
    let (packed, _) = packed_alone(camera, 0.001);
    assert!(
        packed.tables[0]
            .tried
            .iter()
            .any(|tried| tried.error_px.is_infinite())
    );
    assert!(packed.worst_error_px <= 0.001);
}

#[test]
fn bytes_buy_accuracy_and_too_few_are_refused_with_the_need() {
    let cameras = || rig([smooth_camera(), port_camera()].map(on_small_sensor).into());
    let loose = settings(LOOSEST_PX);
    let errors = [1800, 2400].map(|max_bytes| {
        let packed = pack_within_bytes(&cameras(), &loose, max_bytes).unwrap();
        assert!(packed.bytes.len() <= max_bytes);
        packed.worst_error_px
    });
    assert!(
        errors[1] < errors[0] && errors[0] < LOOSEST_PX,
        "{errors:?}"
    );
    let error = pack_within_bytes(&cameras(), &loose, 500).unwrap_err();
    let PackError::TooFewBytes { need, .. } = error else {
        panic!("{error}");
    };
    assert!(pack_within_bytes(&cameras(), &loose, need).is_ok());
}

#[test]
fn knots_outside_the_calibrated_area_stay_small() {
    let camera = fisheye_camera();
    let corner = camera.field.sample(PixelPoint::new(0.0, 0.0)).s.norm();
    assert!(corner > 5.0, "{corner}");
    for cells in [[16, 13], [40, 32]] {
        let target = table::Target::new(&camera);
        let spline = residual_spline::ResidualSpline::new(&camera, &target, cells);
        let fitted = spline.fit(|_| [0.0; 4]).unwrap();
        let largest = fitted
            .knots
            .iter()
            .flatten()
            .fold(0.0, |m: f64, x| m.max(x.abs()));
        // The field itself has 5.9 at the corner, and the outermost knot lies a cell beyond it.
        assert!(largest < 8.0, "{largest}");
    }
}

#[test]
fn a_bound_below_the_round_off_is_refused_with_the_best_figure() {
    let error = pack(
        &rig(vec![on_small_sensor(smooth_camera())]),
        &settings(1e-6),
    )
    .unwrap_err();
    let PackError::BoundNotReached {
        camera,
        wanted_px,
        best_px,
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!((camera.as_str(), wanted_px), ("left", 1e-6));
    // The round-off of f32 at a focal length of 350 px: a quarter of what it is at 1400.
    assert!(best_px > 7.5e-6 && best_px < 7.5e-5, "{best_px}");
}

#[test]
fn the_nearest_bound_is_taken_where_the_one_asked_for_cannot_be_held() {
    let cameras = || [smooth_camera(), port_camera()].map(on_small_sensor).into();
    let best = |error| match error {
        PackError::BoundNotReached { best_px, .. } => best_px,
        other => panic!("{other}"),
    };
    let refused = best(pack(&rig(cameras()), &settings(1e-6)).unwrap_err());
    let packed = pack_nearest(&rig(cameras()), &settings(1e-6)).unwrap();
    // The other camera may need more, but both are at the round-off of f32.
    let worst = packed.worst_error_px;
    assert!(worst > 1e-6 && worst < 5.0 * refused, "{worst} {refused}");
    // A bound that can be held is held.
    let same = pack_nearest(&rig(cameras()), &settings(0.001)).unwrap();
    assert_eq!(same, pack(&rig(cameras()), &settings(0.001)).unwrap());
    let error = pack_nearest(&rig(cameras()), &settings(f64::NAN)).unwrap_err();
    assert!(matches!(error, PackError::BadSetting { .. }));
}

#[test]
fn six_thousand_pixels_are_within_a_thousandth() {
    let sensor = SensorSize::new(6000, 4000);
    let pose = RigidTransform::new(
        so3::exp(&Vector3::new(2.8, 0.5, -0.9)),
        Vector3::new(100.0, 20.0, -600.0),
    );
    let big = camera("big", distorted_field(sensor, 6000.0), pose);
    let table = patches::fit(&big, [41, 27]).unwrap();
    let bytes = parts().encode_cameras(&[(&big, &table)]).unwrap();
    let bytes = AlignedBytes::from(bytes.as_slice());
    let proof = proof::prove(
        &big,
        Rays::Float(&RayBlob::open(&bytes).unwrap(), 0),
        600.0,
        5,
        &Silent,
    );
    assert!(proof.worst_error_px < 0.001, "{proof:?}");
}

pub fn parts() -> encode::BlobParts {
    encode::BlobParts {
        identity: [0; 16],
        frame: "test".into(),
        max_error_px: 1.0,
        working_distance_mm: 600.0,
        self_tests: Vec::new(),
        pairs: Vec::new(),
        match_noise: None,
        arithmetic: None,
    }
}

/// Of 1280 px at a focal length of 1400 px, and of 6000 px at 6000 px.
#[test]
fn integers_are_proven_within_a_hundredth_and_their_answers_are_repeated() {
    let pose = RigidTransform::new(
        so3::exp(&Vector3::new(2.8, 0.5, -0.9)),
        Vector3::new(100.0, 20.0, -600.0),
    );
    let big = camera(
        "big",
        distorted_field(SensorSize::new(6000, 4000), 6000.0),
        pose,
    );
    let usual = vec![smooth_camera(), port_camera()];
    for (cameras, bound_px, most_px) in [
        (usual, 0.001, 0.004),
        (vec![fisheye_camera()], 0.001, 0.002),
        (vec![big], 0.002, 0.006),
    ] {
        for prefer in [Prefer::Size, Prefer::Speed] {
            let settings = PackSettings {
                prefer,
                with_integers: true,
                ..settings(bound_px)
            };
            let packed = pack(&rig(cameras.clone()), &settings).unwrap();
            let error_px = packed.integer_error_px.unwrap();
            assert!(error_px < most_px, "{prefer:?} {error_px}");
            let bytes = AlignedBytes::from(packed.bytes.as_slice());
            let blob = RayBlob::open(&bytes).unwrap();
            let stated = blob.arithmetic().unwrap();
            assert!(f64::from(stated.max_error_px) >= error_px);
            let integers = proof::IntegerRig::prepare(&blob).unwrap();
            let asked = blob.self_tests().filter(|test| test.answer_len() > 0);
            assert_eq!(integers.run_self_tests(&blob), Ok(asked.count()));
            // Without the section the blob is the same but for its end.
            let plain = PackSettings {
                with_integers: false,
                ..settings
            };
            let plain = pack(&rig(cameras.clone()), &plain).unwrap();
            assert_eq!(plain.integer_error_px, None);
            let after = 8 + 8 + 4 * stated.answers.len();
            assert_eq!(packed.bytes.len(), plain.bytes.len() + after);
        }
    }
}

/// The proof must see an error that is there: moved by a known fraction of a pixel, turned by a
/// known angle, shifted by a known length.
#[test]
fn the_proof_finds_an_error_that_was_put_in() {
    let exact = smooth_camera();
    let table = patches::fit(&exact, [20, 16]).unwrap();
    let prove_as = |truth: &CalibratedCamera| {
        let bytes = parts().encode_cameras(&[(&exact, &table)]).unwrap();
        let bytes = AlignedBytes::from(bytes.as_slice());
        proof::prove(
            truth,
            Rays::Float(&RayBlob::open(&bytes).unwrap(), 0),
            600.0,
            9,
            &Silent,
        )
    };
    assert!(prove_as(&exact).worst_error_px < 0.0005);

    let mut turned = exact.clone();
    let turn = so3::exp(&Vector3::new(0.0, 0.0, 1e-4));
    turned.rig_from_camera.rotation *= turn;
    // About the optical axis: 1e-4 of the distance from the principal point, 819 px at a corner.
    let worst_px = prove_as(&turned).worst_error_px;
    assert!((worst_px - 0.082).abs() < 0.01, "{worst_px}");

    let mut shifted = exact.clone();
    shifted.rig_from_camera.translation_mm.x += 0.1;
    // 0.1 mm at 600 mm and 1400 px are 0.23 px in the center; towards the corners, 30 degrees off
    // axis, a mm across the ray is worth up to 1 / cos^2 as many pixels.
    let worst_px = prove_as(&shifted).worst_error_px;
    assert!((0.23..0.32).contains(&worst_px), "{worst_px}");

    let mut masked = exact.clone();
    masked.coverage.covered[0] = false;
    assert_eq!(prove_as(&masked).worst_error_px, f64::INFINITY);
}

#[test]
fn blob_and_host_give_the_same_points_within_single_precision() {
    let mut third = smooth_camera();
    third.name = "third".into();
    third.rig_from_camera = toed_in(20.0, 650.0);
    let rig = rig(vec![smooth_camera(), port_camera(), third]);
    let packed = pack(&rig, &settings(0.001)).unwrap();
    let bytes = AlignedBytes::from(packed.bytes.as_slice());
    let blob = RayBlob::open(&bytes).unwrap();
    // Across: the bound at 0.43 mm per px. Along: more by 1 / sin(parallax / 2) = 6. Of the two or
    // three cameras together.
    let limit_mm = 2.0 * packed.worst_error_px * 0.43 * 6.0;
    let mut counts = [0; 2];
    for k in 0..2000 {
        let scatter = |step: f64, extent: f64| (f64::from(k) * step).fract() * extent;
        let target = Vector3::new(
            scatter(0.618, 160.0) - 80.0,
            scatter(0.414, 120.0) - 60.0,
            scatter(0.732, 100.0) - 50.0,
        );
        let sightings: Option<Vec<_>> = rig
            .cameras
            .iter()
            .enumerate()
            .map(|(idx, camera)| {
                let pixel = self_test::pixel_nearest(camera, &target)?;
                Some((idx, pixel))
            })
            .collect();
        let Some(sightings) = sightings else { continue };
        let asked: Vec<_> = sightings.iter().map(|(c, p)| (*c, device(*p))).collect();
        for count in [2, 3] {
            let host = rig.triangulate(&sightings[..count]).unwrap();
            let blob = blob.triangulate_many(&asked[..count]).unwrap();
            let difference = (Vector3::from(blob.point_mm.map(f64::from)) - host.point_mm).norm();
            assert!(difference < limit_mm, "{difference} of {limit_mm}");
            let gap_difference = (f64::from(blob.gap_mm()) - host.gap_mm).abs();
            assert!(gap_difference < limit_mm, "{gap_difference}");
            counts[count - 2] += 1;
        }
    }
    assert!(counts[0] > 1000, "{counts:?}");
}

#[test]
fn blob_and_host_refuse_the_same_pixels() {
    let mut camera = smooth_camera();
    let corners = [(200.0, 150.0), (1100.0, 230.0), (700.0, 900.0)];
    camera.coverage =
        CoverageMask::from_corners(SENSOR, corners.iter().map(|(u, v)| PixelPoint::new(*u, *v)));
    let (_, bytes) = packed_alone(camera.clone(), 0.01);
    let blob = RayBlob::open(&bytes).unwrap();
    let mut covered = 0;
    for v in -3..2060 {
        for u in -3..2570 {
            let pixel = PixelPoint::new(f64::from(u) / 2.0, f64::from(v) / 2.0);
            let host = camera.coverage.contains(pixel);
            assert_eq!(blob.is_calibrated(0, device(pixel)), host, "{pixel:?}");
            covered += usize::from(host);
        }
    }
    assert!(covered > 100_000);
}

#[test]
fn the_blob_says_what_it_is() {
    let packed = pack(&rig(vec![smooth_camera(), port_camera()]), &settings(0.001)).unwrap();
    let bytes = AlignedBytes::from(packed.bytes.as_slice());
    let blob = RayBlob::open(&bytes).unwrap();
    assert_eq!(blob.identity(), b"0123456789abcdef");
    assert_eq!(blob.frame(), "board at pose 0");
    assert_eq!(blob.camera_index("port"), Some(1));
    let left = blob.camera(0).unwrap();
    assert_eq!((left.sensor_width, left.sensor_height), (1280, 1024));
    // Two rays for each camera, four matches.
    assert_eq!(blob.run_self_tests(), Ok(8));
    assert_eq!(packed.tables[1].camera, "port");
    let last = packed.curve.last().unwrap();
    assert!(last.error_px <= 0.001 && last.bytes < packed.bytes.len() * 2);
    assert!(
        packed
            .curve
            .is_sorted_by(|a, b| a.bytes < b.bytes && a.error_px > b.error_px),
        "{:?}",
        packed.curve
    );
}

#[test]
fn same_rig_same_bytes() {
    let rig = rig(vec![smooth_camera(), fisheye_camera()]);
    let first = pack(&rig, &settings(0.01)).unwrap();
    assert_eq!(first, pack(&rig, &settings(0.01)).unwrap());
}

#[test]
fn what_cannot_be_packed_is_refused_with_its_reason() {
    let refusal =
        |cameras: Vec<CalibratedCamera>| pack(&rig(cameras), &settings(0.01)).unwrap_err();
    let camera = smooth_camera();

    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = pack(&rig(vec![camera.clone()]), &settings(bad)).unwrap_err();
        assert!(matches!(error, PackError::BadSetting { .. }), "{error}");
    }
    let mut blind = camera.clone();
    blind.coverage = CoverageMask::uniform(SENSOR, false);
    assert!(matches!(
        refusal(vec![blind]),
        PackError::NothingCalibrated { .. }
    ));

    let mut other_mask = camera.clone();
    other_mask.coverage = CoverageMask::uniform(SensorSize::new(640, 512), true);
    assert!(matches!(refusal(vec![other_mask]), PackError::Mask { .. }));

    let mut huge = camera.clone();
    huge.field.sensor = SensorSize::new(40000, 4);
    huge.coverage = CoverageMask::uniform(huge.field.sensor, true);
    assert!(matches!(refusal(vec![huge]), PackError::SensorSize { .. }));

    let mut nan = camera.clone();
    nan.field.direction.polynomial.coefficients[0].x = f64::NAN;
    assert!(matches!(refusal(vec![nan]), PackError::Field { .. }));

    let mut beyond = fisheye_camera();
    beyond.coverage = CoverageMask::uniform(SENSOR, true);
    assert!(matches!(refusal(vec![beyond]), PackError::Field { .. }));

    let mut stretched = camera.clone();
    stretched.rig_from_camera.rotation *= 1.01;
    let error = refusal(vec![stretched]);
    assert!(
        matches!(error, PackError::Refused(OpenError::BadNumber { .. })),
        "{error}"
    );

    let twins = refusal(vec![camera.clone(), camera]);
    assert!(
        matches!(twins, PackError::Refused(OpenError::BadMeta)),
        "{twins}"
    );
    assert!(matches!(
        refusal(Vec::new()),
        PackError::Refused(OpenError::BadHeader)
    ));
}

#[test]
fn a_file_is_read_onto_an_aligned_address() {
    let (packed, _) = packed_alone(smooth_camera(), 0.01);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.rays");
    std::fs::write(&path, &packed.bytes).unwrap();
    let bytes = read_aligned(&path).unwrap();
    assert_eq!(*bytes, packed.bytes[..]);
    assert!(RayBlob::open(&bytes).is_ok());
}
