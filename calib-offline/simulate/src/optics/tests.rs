//! Every kind of optics against identities that hold exactly.

use super::*;
use crate::preset::{OpticsKind, rig};
use calib_rays::geometry::{PixelPoint, Ray, SensorSize};
use nalgebra::Vector3;

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

fn pinhole() -> Lens {
    perspective(Distortion::None)
}

fn perspective(distortion: Distortion) -> Lens {
    Lens::Perspective(PerspectiveLens {
        focal_px: [1000.0, 1100.0],
        principal: PixelPoint::new(640.0, 500.0),
        distortion,
        bumps: Vec::new(),
    })
}

fn lattice() -> impl Iterator<Item = PixelPoint> {
    (0..=8).flat_map(|j| {
        (0..=10)
            .map(move |i| PixelPoint::new(127.9 * f64::from(i) - 0.5, 128.0 * f64::from(j) - 0.5))
    })
}

/// Both rays lie on one line: each one's points are on the other, mm.
fn line_distance_mm(a: &Ray, b: &Ray) -> f64 {
    [0.0, 500.0]
        .iter()
        .map(|along| a.distance_mm(&(b.origin_mm + b.direction * *along)))
        .fold(0.0, f64::max)
}

#[test]
fn a_pinhole_sees_along_the_similar_triangles() {
    let camera = CameraOptics::new(SENSOR, pinhole(), Media::Air);
    let ray = camera.ray(PixelPoint::new(740.0, 610.0)).unwrap();
    let expected = Vector3::new(0.1, 0.1, 1.0).normalize();
    assert!((ray.direction - expected).norm() < 1e-15);
    assert_eq!(ray.origin_mm, Vector3::zeros());
    let pixel = camera.project(&Vector3::new(50.0, -20.0, 500.0)).unwrap();
    assert!(pixel.distance_px(PixelPoint::new(740.0, 456.0)) < 1e-10);
}

#[test]
fn brown_conrady_inverts_its_own_formula() {
    let distortion = Distortion::Brown {
        k1: -0.25,
        k2: 0.12,
        k3: -0.03,
        p1: 1e-3,
        p2: -7e-4,
    };
    for pixel in lattice() {
        let distorted =
            nalgebra::Vector2::new((pixel.u - 640.0) / 1000.0, (pixel.v - 512.0) / 1000.0);
        let ideal = distortion.undistort(distorted).unwrap();
        let again = distortion.distort(ideal).unwrap();
        assert!((again - distorted).norm() < 1e-15 * 4.0, "{pixel:?}");
    }
    // By hand at (0.5, 0): r^2 = 0.25, radial 1 - 0.0625 + 0.0075 - 0.00046875 = 0.94453125;
    // x = 0.472265625 + p2 * 0.75, y = p1 * 0.25.
    let image = distortion
        .distort(nalgebra::Vector2::new(0.5, 0.0))
        .unwrap();
    assert!((image.x - (0.472265625 - 7e-4 * 0.75)).abs() < 1e-16);
    assert!((image.y - 1e-3 * 0.25).abs() < 1e-18);
}

#[test]
fn the_search_for_a_pixel_agrees_with_the_closed_form_of_brown_conrady() {
    let distortion = Distortion::Brown {
        k1: -0.2,
        k2: 0.1,
        k3: 0.0,
        p1: 5e-4,
        p2: 3e-4,
    };
    let camera = CameraOptics::new(SENSOR, perspective(distortion), Media::Air);
    for point in [
        Vector3::new(10.0, 20.0, 400.0),
        Vector3::new(-150.0, 90.0, 350.0),
        Vector3::new(200.0, -150.0, 420.0),
    ] {
        let image = distortion.distort(point.xy() / point.z).unwrap();
        let expected = PixelPoint::new(640.0 + 1000.0 * image.x, 500.0 + 1100.0 * image.y);
        let found = camera.project(&point).unwrap();
        assert!(
            found.distance_px(expected) < 1e-10,
            "{found:?} {expected:?}"
        );
    }
}

#[test]
fn a_polynomial_that_folds_over_has_no_rays_beyond_the_fold() {
    // r (1 - r^2) turns back at r = 0.577, distorted 0.385.
    let distortion = Distortion::Brown {
        k1: -1.0,
        k2: 0.0,
        k3: 0.0,
        p1: 0.0,
        p2: 0.0,
    };
    assert!(distortion.undistort([0.38, 0.0].into()).is_some());
    assert!(distortion.undistort([0.39, 0.0].into()).is_none());
}

#[test]
fn a_plate_in_air_shifts_rays_and_does_not_bend_them() {
    let (thickness_mm, index) = (12.0, 1.52);
    let window = |thickness_mm| {
        Media::Flat(FlatWindow {
            normal: Vector3::new(0.3, -0.1, 1.0).normalize(),
            distance_mm: 40.0,
            thickness_mm,
            index,
            index_behind: 1.0,
        })
    };
    let bare = CameraOptics::new(SENSOR, pinhole(), Media::Air);
    let plate = CameraOptics::new(SENSOR, pinhole(), window(thickness_mm));
    let foil = CameraOptics::new(SENSOR, pinhole(), window(0.0));
    for pixel in lattice() {
        let ray = bare.ray(pixel).unwrap();
        let behind = plate.ray(pixel).unwrap();
        assert!((ray.direction - behind.direction).norm() < 1e-15);
        // Textbook: t sin(a) (1 - cos(a) / sqrt(n^2 - sin(a)^2)).
        let normal = Vector3::new(0.3, -0.1, 1.0).normalize();
        let cos = ray.direction.dot(&normal);
        let sin = ray.direction.cross(&normal).norm();
        let expected = thickness_mm * sin * (1.0 - cos / (index * index - sin * sin).sqrt());
        let shift = ray.distance_mm(&behind.origin_mm);
        assert!((shift - expected).abs() < 1e-12, "{shift} {expected}");
        assert!(line_distance_mm(&ray, &foil.ray(pixel).unwrap()) < 1e-12);
    }
}

#[test]
fn a_port_bends_by_snell_and_equal_media_do_not_bend() {
    let port = |index: f64, index_behind: f64| {
        Media::Flat(FlatWindow {
            normal: Vector3::z(),
            distance_mm: 30.0,
            thickness_mm: 10.0,
            index,
            index_behind,
        })
    };
    let bare = CameraOptics::new(SENSOR, pinhole(), Media::Air);
    let water = CameraOptics::new(SENSOR, pinhole(), port(1.49, 1.333));
    // 1.0 takes the short cut for windows; a hair above it goes through Snell at every face.
    let nearly_air = CameraOptics::new(SENSOR, pinhole(), port(1.0, 1.0 + 1e-15));
    for pixel in lattice() {
        let ray = bare.ray(pixel).unwrap();
        let sin_air = ray.direction.xy().norm();
        let wet = water.ray(pixel).unwrap();
        assert!((1.333 * wet.direction.xy().norm() - sin_air).abs() < 1e-14);
        assert!((wet.origin_mm.z - 40.0).abs() < 1e-12);
        assert!(line_distance_mm(&ray, &nearly_air.ray(pixel).unwrap()) < 1e-10);
    }
}

#[test]
fn a_dome_bends_nothing_at_its_center_and_something_off_it() {
    let dome = |center_mm| {
        Media::Dome(Dome {
            center_mm,
            inner_radius_mm: 50.0,
            thickness_mm: 8.0,
            index: 1.49,
            index_behind: 1.333,
        })
    };
    let bare = CameraOptics::new(SENSOR, pinhole(), Media::Air);
    let centered = CameraOptics::new(SENSOR, pinhole(), dome(Vector3::zeros()));
    let off = CameraOptics::new(SENSOR, pinhole(), dome(Vector3::new(0.0, 0.0, 10.0)));
    let mut bent = 0.0_f64;
    for pixel in lattice() {
        let ray = bare.ray(pixel).unwrap();
        assert!(line_distance_mm(&ray, &centered.ray(pixel).unwrap()) < 1e-11);
        bent = bent.max(line_distance_mm(&ray, &off.ray(pixel).unwrap()));
    }
    assert!(bent > 5.0, "{bent} mm");
    // A lens outside its dome has no rays.
    let outside = CameraOptics::new(SENSOR, pinhole(), dome(Vector3::new(0.0, 0.0, 60.0)));
    assert!(outside.ray(PixelPoint::new(640.0, 500.0)).is_none());
}

#[test]
fn the_fisheyes_pupil_moves_and_its_circle_ends() {
    let lens = FisheyeLens {
        focal_px: 440.0,
        principal: PixelPoint::new(640.0, 500.0),
        k1: 0.01,
        k2: -0.005,
        pupil_mm: [1.5, 0.1],
        max_angle_rad: 82.5_f64.to_radians(),
    };
    let camera = CameraOptics::new(SENSOR, Lens::Fisheye(lens), Media::Air);
    let theta: f64 = 1.2;
    let radius_px = 440.0 * theta * (1.0 + 0.01 * theta.powi(2) - 0.005 * theta.powi(4));
    let ray = camera
        .ray(PixelPoint::new(
            640.0 + 0.6 * radius_px,
            500.0 + 0.8 * radius_px,
        ))
        .unwrap();
    let expected = Vector3::new(0.6 * theta.sin(), 0.8 * theta.sin(), theta.cos());
    assert!((ray.direction - expected).norm() < 1e-14);
    let pupil_mm = 1.5 * theta.powi(2) + 0.1 * theta.powi(4);
    assert!((ray.origin_mm - Vector3::new(0.0, 0.0, pupil_mm)).norm() < 1e-14);
    assert!(camera.ray(PixelPoint::new(0.0, 0.0)).is_none());
    // The axis itself is no special case.
    let axis = camera.ray(PixelPoint::new(640.0, 500.0)).unwrap();
    assert_eq!(axis.direction, Vector3::z());
}

#[test]
fn points_behind_and_beyond_the_edge_have_no_pixel() {
    let camera = CameraOptics::new(SENSOR, pinhole(), Media::Air);
    assert!(camera.project(&Vector3::new(0.0, 0.0, -300.0)).is_none());
    let beyond = Vector3::new(400.0, 0.0, 500.0);
    assert!(camera.project(&beyond).is_none());
    let pixel = camera.project_unclipped(&beyond).unwrap();
    assert!(pixel.distance_px(PixelPoint::new(1440.0, 500.0)) < 1e-9);
}

#[test]
fn a_larger_sensor_sees_the_same_scene() {
    for kind in OpticsKind::ALL {
        let small = &rig(kind, SensorSize::new(640, 512)).cameras[0];
        let large = &rig(kind, SensorSize::new(2560, 2048)).cameras[0];
        let center = |camera: &CameraOptics| camera.ray(camera.sensor().center()).unwrap();
        let angle = center(small)
            .direction
            .cross(&center(large).direction)
            .norm();
        assert!(angle < 1e-12, "{kind:?}: {angle} rad");
    }
}
