//! Rigs to pack, and what must hold of the blobs.

use super::*;
use crate::field::spline::Spline;
use crate::field::{BaseLens, CalibratedCamera, CoverageMask, Projection, RayField, SmoothMap};
use crate::geometry::{RigidTransform, SensorSize, so3};
use nalgebra::{Vector2, Vector3};

const SENSOR: SensorSize = SensorSize::new(1280, 1024);

/// A camera on the x axis of the rig that looks at the origin from `distance_mm`.
fn toed_in(x_mm: f64, distance_mm: f64) -> RigidTransform {
    let yaw = so3::exp(&Vector3::new(0.0, -(x_mm / distance_mm).atan(), 0.0));
    let translation = Vector3::new(x_mm, 3.0, -distance_mm);
    RigidTransform::new(yaw * so3::exp(&Vector3::new(0.02, 0.0, 0.01)), translation)
}

fn camera(name: &str, field: RayField, rig_from_camera: RigidTransform) -> CalibratedCamera {
    CalibratedCamera {
        name: name.into(),
        coverage: CoverageMask::uniform(field.sensor, true),
        field,
        rig_from_camera,
    }
}

/// A perspective lens with radial and tangential distortion of some tens of pixels.
fn distorted_field(sensor: SensorSize, focal_px: f64) -> RayField {
    let base = BaseLens {
        projection: Projection::Perspective,
        focal_px,
    };
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

/// 165 degrees across the diagonal's image circle; calibrated inside the circle only, and the
/// polynomial runs away outside.
pub fn fisheye_camera() -> CalibratedCamera {
    let base = BaseLens {
        projection: Projection::Equidistant,
        focal_px: 450.0,
    };
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

use crate::field::spline::SplineGrid;

fn rig(cameras: Vec<CalibratedCamera>) -> Rig {
    Rig {
        cameras,
        datum_pose: 0,
    }
}

#[test]
fn figures() {
    for cam in [
        smooth_camera(),
        bumpy_camera(),
        port_camera(),
        fisheye_camera(),
        camera(
            "big",
            distorted_field(SensorSize::new(6000, 4000), 6000.0),
            toed_in(100.0, 600.0),
        ),
    ] {
        for e in [0.01, 0.001, 0.0003, 0.00003] {
            let t = std::time::Instant::now();
            let settings = PackSettings {
                max_error_px: e,
                working_distance_mm: 600.0,
                ..PackSettings::default()
            };
            match pack(&rig(vec![cam.clone()]), &settings) {
                Ok(p) => eprintln!(
                    "{} {e}: {:?} {} B of {} worst {:.2e} rms {:.2e} {:?} {:?} {:.2}s",
                    cam.name,
                    p.grids[0].cells,
                    p.grids[0].bytes,
                    p.bytes.len(),
                    p.worst_error_px,
                    p.grids[0].proof.rms_error_px,
                    p.grids[0].proof.worst_at,
                    p.curve,
                    t.elapsed().as_secs_f64()
                ),
                Err(err) => eprintln!("{} {e}: {err} {:.2}s", cam.name, t.elapsed().as_secs_f64()),
            }
        }
    }
}
