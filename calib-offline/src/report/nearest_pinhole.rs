//! A camera in the frame of the pinhole that comes nearest to its rays.
//!
//! The frame of a ray field is a gauge of its own: its axis need not be the lens's. Baselines and angles compare with those of
//! other tools in the pinhole's frame, whose axis goes through the principal point.

use calib_exchange::CameraPinhole;
use calib_rays::geometry::{RigidTransform, so3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The pinhole that comes nearest to a camera's rays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NearestPinhole {
    /// Name of the camera.
    pub camera: String,
    /// Where it is: its center is the point nearest to all rays, z goes through the principal point, x runs along the
    /// sensor's rows.
    pub rig_from_pinhole: RigidTransform,
    /// `[fx, fy]`, px.
    pub focal_px: [f64; 2],
    /// The principal point `[cx, cy]`, px.
    pub principal_point_px: [f64; 2],
    /// Coefficients in `OpenCV`'s order.
    pub distortion: Vec<f64>,
    /// Where on the rays it was fitted, mm from the camera.
    pub distance_mm: f64,
    /// RMS distance of its pixels from those of the rays, px.
    pub rms_px: f64,
    /// The largest, px.
    pub max_px: f64,
}

impl NearestPinhole {
    /// The record of a pinhole.
    pub fn new(found: &CameraPinhole, distance_mm: f64) -> Self {
        Self {
            camera: found.name.clone(),
            rig_from_pinhole: found.rig_from_pinhole,
            focal_px: found.lens.focal_px,
            principal_point_px: found.lens.center_px,
            distortion: found.lens.own_coefficients().to_vec(),
            distance_mm,
            rms_px: found.loss.rms_px,
            max_px: found.loss.max_px,
        }
    }

    /// From the center of this one to that of another, mm.
    pub fn baseline_mm(&self, other: &Self) -> f64 {
        let offset = other.rig_from_pinhole.translation_mm - self.rig_from_pinhole.translation_mm;
        offset.norm()
    }

    /// The angle of the turn from this frame to another, rad.
    pub fn turn_rad(&self, other: &Self) -> f64 {
        let turn = self.rig_from_pinhole.inverse() * other.rig_from_pinhole;
        so3::angle_rad(&turn.rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};

    #[test]
    fn a_turn_counts_whatever_its_axis() {
        let at = |x_mm: f64, turn: Vector3<f64>| NearestPinhole {
            camera: "left".to_owned(),
            rig_from_pinhole: RigidTransform::new(
                Rotation3::new(turn).into_inner(),
                Vector3::new(x_mm, 0.0, 4.0),
            ),
            focal_px: [1000.0; 2],
            principal_point_px: [0.0; 2],
            distortion: Vec::new(),
            distance_mm: 500.0,
            rms_px: 0.0,
            max_px: 0.0,
        };
        let (left, right) = (
            at(3.0, Vector3::zeros()),
            at(123.0, Vector3::new(0.0, 0.0, 0.3)),
        );
        assert!((left.baseline_mm(&right) - 120.0).abs() < 1e-12);
        assert!((left.turn_rad(&right) - 0.3).abs() < 1e-12);
        assert!((right.turn_rad(&left) - 0.3).abs() < 1e-12);
    }
}
