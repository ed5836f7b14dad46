//! Pinholes found back from their own rays, and the cost of those that are none.

use super::*;
use calib_blob::rays::{RaySource, SourceCamera};
use calib_estimate::pinhole::BrownCamera;
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, SensorSize, so3};
use calib_simulate::optics::Lens as TrueLens;
use calib_simulate::{OpticsKind, Scene, SceneSettings};
use nalgebra::Vector3;

pub(super) const SENSOR: SensorSize = SensorSize::new(1280, 1024);
pub(super) const BROWN: BrownCamera = BrownCamera {
    sensor: SENSOR,
    focal_px: [1745.0, 1746.2],
    center_px: [652.5, 500.5],
    distortion: [-0.18, 0.12, 6e-4, -4e-4, -0.04],
};

/// Cameras by their rays in their own frames.
pub(super) struct Known<F> {
    pub rig_from_camera: Vec<RigidTransform>,
    pub ray: F,
}

impl<F: Fn(usize, PixelPoint) -> Option<Ray> + Sync> RaySource for Known<F> {
    fn cameras(&self) -> Vec<SourceCamera> {
        let places = self.rig_from_camera.iter().enumerate();
        places
            .map(|(k, rig_from_camera)| SourceCamera {
                name: format!("c{k}"),
                sensor: SENSOR,
                rig_from_camera: *rig_from_camera,
            })
            .collect()
    }

    fn ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        let ray = (self.ray)(camera_idx, pixel)?.transformed(&self.rig_from_camera[camera_idx]);
        Some(Ray {
            direction: ray.direction.normalize(),
            ..ray
        })
    }
}

pub(super) fn place(turn: [f64; 3], at_mm: [f64; 3]) -> RigidTransform {
    RigidTransform::new(so3::exp(&Vector3::from(turn)), Vector3::from(at_mm))
}

#[test]
fn browns_pinhole_is_found_back_in_any_frame() {
    // The field's frame is turned and moved against the pinhole's.
    let field_from_pinhole = place([0.01, -0.02, 0.004], [1.0, -2.0, 3.0]);
    let rig_from_camera = place([0.3, 0.1, -0.2], [40.0, 50.0, -600.0]);
    let source = Known {
        rig_from_camera: vec![rig_from_camera],
        ray: |_, pixel| Some(BROWN.ray(pixel)?.transformed(&field_from_pinhole)),
    };
    let forms = [Distortion::Five, Distortion::Eight];
    let found = nearest_pinholes(&source, 600.0, &forms).unwrap();
    let camera = &found.cameras[0];
    assert!(
        camera.loss.max_px < 1e-6 && camera.loss.max_mm < 1e-6,
        "{:?}",
        camera.loss
    );
    assert_eq!(camera.lens.distortion, Distortion::Five);
    let numbers = camera.lens.focal_px.iter().chain(&camera.lens.center_px);
    let numbers = numbers.chain(camera.lens.own_coefficients());
    for (found, truth) in numbers.zip(BROWN.intrinsics()) {
        assert!(
            (found - truth).abs() < 1e-5 * truth.abs().max(1.0),
            "{found} {truth}"
        );
    }
    let truth = rig_from_camera * field_from_pinhole;
    let turned = camera.rig_from_pinhole.rotation - truth.rotation;
    assert!(turned.norm() < 1e-7);
    let moved_mm = camera.rig_from_pinhole.translation_mm - truth.translation_mm;
    assert!(moved_mm.norm() < 1e-6);
}

#[test]
fn a_simulated_brown_rig_has_its_lenses_and_its_extrinsics() {
    let scene = Scene::new(SceneSettings::standard(OpticsKind::Brown, 1)).unwrap();
    let source = Known {
        rig_from_camera: scene.left_from_camera.clone(),
        ray: |camera_idx, pixel| scene.true_ray(camera_idx, pixel),
    };
    assert_eq!(scene.cameras[0].sensor(), SENSOR);
    let found = nearest_pinholes(&source, 350.0, &[Distortion::Five, Distortion::Eight]).unwrap();
    for (camera, place) in found.cameras.iter().zip(&scene.left_from_camera) {
        let moved = place.inverse() * camera.rig_from_pinhole;
        assert!(moved.translation_mm.norm() < 1e-3, "{moved:?}");
    }
    for (camera, truth) in found.cameras.iter().zip(&scene.cameras) {
        println!("{}: {:?}", camera.name, camera.loss);
        assert!(camera.loss.max_px < 0.02);
        let TrueLens::Perspective(truth) = truth.lens() else {
            panic!("Brown's lens is a perspective one");
        };
        for (found, truth) in camera.lens.focal_px.iter().zip(truth.focal_px) {
            assert!((found / truth - 1.0).abs() < 1e-5, "{found} {truth}");
        }
        let [u, v] = camera.lens.center_px;
        assert!(PixelPoint::new(u, v).distance_px(truth.principal) < 0.05);
    }
}

#[test]
fn a_fisheye_takes_the_rational_form() {
    // Equidistant: 62 degrees off axis at the corner.
    let source = Known {
        rig_from_camera: vec![RigidTransform::identity()],
        ray: |_, pixel: PixelPoint| {
            let (x, y) = ((pixel.u - 639.5) / 760.0, (pixel.v - 511.5) / 760.0);
            let angle = f64::hypot(x, y);
            let share = if angle > 0.0 {
                angle.sin() / angle
            } else {
                1.0
            };
            Some(Ray {
                origin_mm: Vector3::zeros(),
                direction: Vector3::new(x * share, y * share, angle.cos()),
            })
        },
    };
    let loss = |forms: &[Distortion]| nearest_pinholes(&source, 500.0, forms).unwrap().loss();
    let (five, eight) = (
        loss(&[Distortion::Five]),
        loss(&[Distortion::Five, Distortion::Eight]),
    );
    println!("{five:?} {eight:?}");
    assert!(eight.rms_px < 0.8 * five.rms_px);
    // A millimeter at 500 mm is 1.5 px or so in the middle.
    let scale = five.rms_px / five.rms_mm;
    assert!((0.5..3.0).contains(&scale), "{scale}");
}

#[test]
fn what_no_pinhole_sees_is_refused() {
    let refused = |ray: fn(PixelPoint) -> Option<Ray>| {
        let source = Known {
            rig_from_camera: vec![RigidTransform::identity()],
            ray: move |_, pixel| ray(pixel),
        };
        nearest_pinholes(&source, 500.0, &[Distortion::Five]).unwrap_err()
    };
    let parallel = refused(|pixel| {
        Some(Ray {
            origin_mm: Vector3::new(pixel.u / 10.0, pixel.v / 10.0, 0.0),
            direction: Vector3::z(),
        })
    });
    assert!(
        matches!(parallel, ExchangeError::NoPinhole { .. }),
        "{parallel}"
    );
    let mirrored = refused(|pixel| {
        Some(Ray {
            origin_mm: Vector3::zeros(),
            direction: Vector3::new(640.0 - pixel.u, pixel.v - 512.0, 1500.0),
        })
    });
    assert!(matches!(mirrored, ExchangeError::NoPinhole { .. }));
    let small = refused(|pixel| {
        (pixel.u < 100.0 && pixel.v < 100.0).then(|| Ray {
            origin_mm: Vector3::zeros(),
            direction: Vector3::new(pixel.u, pixel.v, 1500.0),
        })
    });
    assert!(matches!(small, ExchangeError::TooFewRays { .. }));
}
