//! From points to pixels, and between images and sensors.

use crate::test_blob::{TestBlob, TestCamera, encoding};
use nalgebra::Vector3;
use ray_runtime::format::Form;
use ray_runtime::{
    MeasureError, PixelPoint, ProjectError, Ray, RayBlob, Readout, ReadoutError, SensorWindow,
};
use split_mix::SplitMix;

const FORMS: [Form; 3] = [Form::Spline, Form::Patches, Form::Quantized];

/// Two cameras, the second of which is not central and toed in, calibrated but for one corner.
fn content(form: Form) -> TestBlob {
    let mut first = TestCamera::new("first", -80.0);
    first.encoding = encoding(form, true);
    let mut second = TestCamera::new("second", 80.0);
    second.encoding = encoding(form, false);
    second.offset_mm = [1.5, -0.75];
    let (sin, cos) = (0.28, 0.96);
    second.rotation = [cos, 0.0, -sin, 0.0, 1.0, 0.0, sin, 0.0, cos];
    second.mask[11] = false;
    TestBlob::new(vec![first, second])
}

fn each_form(check: fn(&RayBlob<'_>)) {
    for form in FORMS {
        let bytes = content(form).bytes();
        check(&RayBlob::open(bytes.bytes()).unwrap());
    }
}

/// The point of a ray at a multiple of its direction.
fn at(ray: &Ray, lambda: f32) -> [f32; 3] {
    (Vector3::from(ray.origin_mm) + Vector3::from(ray.direction) * lambda).into()
}

fn distance_px(a: PixelPoint, b: PixelPoint) -> f32 {
    (a.u - b.u).hypot(a.v - b.v)
}

#[test]
fn a_point_on_a_pixels_ray_is_projected_to_that_pixel() {
    each_form(|blob| {
        let mut random = SplitMix(7);
        let mut found = 0;
        for _ in 0..2000 {
            let camera = random.below(2);
            let pixel = PixelPoint::new(random.between(-0.5, 63.5), random.between(-0.5, 47.5));
            let Ok(ray) = blob.lookup(camera, pixel) else {
                continue;
            };
            let point = at(&ray, random.between(100.0, 1000.0));
            let again = blob.project(camera, point).unwrap();
            // A pixel is 2 mm at 100 mm; points of 1000 mm have steps of 6e-5 mm.
            assert!(distance_px(again, pixel) < 1e-4, "{pixel:?} {again:?}");
            let start = PixelPoint::new(pixel.u + 3.0, pixel.v - 2.0);
            let near = blob.project_near(camera, point, start).unwrap();
            assert!(distance_px(near, pixel) < 1e-4, "{pixel:?} {near:?}");
            found += 1;
        }
        assert!(found > 1800, "{found}");
    });
}

#[test]
fn points_that_no_calibrated_pixel_sees_have_none() {
    each_form(|blob| {
        let unseen = |camera, x, y, z| {
            let error = blob.project(camera, [x, y, z]).unwrap_err();
            assert_eq!(error, ProjectError::Unseen);
        };
        // Behind, far to the side, at the camera itself, no number.
        unseen(0, -80.0, 0.0, -500.0);
        unseen(0, 5000.0, 0.0, 100.0);
        unseen(0, -80.0, 0.0, 0.0);
        unseen(0, f32::NAN, 0.0, 100.0);
        unseen(0, f32::INFINITY, 0.0, 100.0);
        // Seen by a pixel that is not calibrated: in the corner that is left out, whose rays are those
        // of the other camera turned.
        let corner = PixelPoint::new(60.0, 45.0);
        assert!(!blob.is_calibrated(1, corner) && blob.is_calibrated(0, corner));
        let ray = blob.lookup(1, PixelPoint::new(46.0, 31.0)).unwrap();
        let beyond = Vector3::from(ray.direction) + Vector3::new(0.25, 0.2, 0.0);
        unseen(
            1,
            80.0 + 500.0 * beyond.x,
            500.0 * beyond.y,
            500.0 * beyond.z,
        );
        assert_eq!(
            blob.project(2, [0.0, 0.0, 1.0]),
            Err(ProjectError::NoSuchCamera {
                camera: 2,
                count: 2
            })
        );
        // A start that is nowhere is as good as the middle.
        let middle = blob.lookup(0, PixelPoint::new(31.5, 23.5)).unwrap();
        let point = at(&middle, 300.0);
        let start = PixelPoint::new(f32::NAN, f32::INFINITY);
        let pixel = blob.project_near(0, point, start).unwrap();
        assert!(distance_px(pixel, PixelPoint::new(31.5, 23.5)) < 1e-4);
    });
}

#[test]
fn matches_on_an_epipolar_curve_meet() {
    each_form(|blob| {
        let pixel = PixelPoint::new(40.25, 20.5);
        let curve = blob
            .epipolar_curve((0, pixel), 1, [250.0, 2000.0], 40)
            .unwrap();
        let points: Vec<_> = curve.collect();
        assert!(points.len() > 20, "{}", points.len());
        for point in &points {
            let found = blob.triangulate((0, pixel), (1, point.pixel)).unwrap();
            // 1e-4 px of 2 mm at 100 mm each; along the ray by the parallax more.
            assert!(found.gap_mm() < 5e-3, "{point:?} {found:?}");
            let [found, point] = [found.point_mm, point.point_mm].map(Vector3::from);
            assert!((found - point).norm() < 1e-4 * point.norm());
        }
        // From far to near, without a jump.
        let depths: Vec<f32> = points.iter().map(|p| p.point_mm[2]).collect();
        assert!(depths.is_sorted_by(|a, b| a > b));
        let steps = points.windows(2);
        let steps = steps.map(|pair| distance_px(pair[0].pixel, pair[1].pixel));
        let (shortest, longest) = steps.fold((f32::INFINITY, 0.0_f32), |(low, high), step| {
            (low.min(step), high.max(step))
        });
        assert!(longest < 4.0 * shortest, "{shortest} {longest}");

        let ask = |camera, pixel, other, range| {
            blob.epipolar_curve((camera, pixel), other, range, 10)
                .map(Iterator::count)
        };
        assert_eq!(ask(0, pixel, 1, [0.0, 100.0]), Ok(0));
        assert_eq!(ask(0, pixel, 1, [f32::NAN, 100.0]), Ok(0));
        let outside = PixelPoint::new(-3.0, 0.0);
        assert_eq!(
            ask(0, outside, 1, [250.0, 500.0]),
            Err(MeasureError::Outside { camera: 0 })
        );
        assert!(matches!(
            ask(0, pixel, 5, [250.0, 500.0]),
            Err(MeasureError::NoSuchCamera { camera: 5, .. })
        ));
    });
}

#[test]
fn a_readout_is_mapped_to_the_sensor_and_another_sensor_is_refused() {
    let bytes = content(Form::Patches).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let camera = blob.camera(0).unwrap();
    let readout = Readout {
        sensor: [64, 48],
        first: [16, 8],
        image: [10, 12],
        binning: [4, 2],
    };
    let window = SensorWindow::new(&camera, &readout).unwrap();
    // The first image pixel joins columns 16 to 19 and rows 8 and 9.
    let first = window.to_sensor(PixelPoint::new(0.0, 0.0));
    assert_eq!(first, PixelPoint::new(17.5, 8.5));
    let other = window.to_sensor(PixelPoint::new(2.25, 3.5));
    assert_eq!(other, PixelPoint::new(26.5, 15.5));
    assert_eq!(window.from_sensor(other), PixelPoint::new(2.25, 3.5));

    let whole = Readout {
        first: [0, 0],
        image: [64, 48],
        binning: [1, 1],
        ..readout
    };
    let same = SensorWindow::new(&camera, &whole).unwrap();
    let pixel = PixelPoint::new(12.3, 45.6);
    assert_eq!(same.to_sensor(pixel), pixel);

    let refused = |change: fn(&mut Readout)| {
        let mut readout = whole;
        change(&mut readout);
        SensorWindow::new(&camera, &readout).unwrap_err()
    };
    assert_eq!(
        refused(|r| r.sensor = [128, 96]),
        ReadoutError::WrongSensor {
            calibrated: [64, 48],
            found: [128, 96]
        }
    );
    for change in [
        (|r| r.first = [1, 0]) as fn(&mut Readout),
        |r| r.image = [0, 48],
        |r| r.image = [64, 49],
        |r| r.binning = [0, 1],
        |r| r.binning = [2, 1],
        |r| r.image = [u32::MAX, u32::MAX],
    ] {
        assert_eq!(refused(change), ReadoutError::NotOnSensor);
    }
}
