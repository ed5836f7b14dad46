//! Calibrated cameras in one common frame: what an estimate hands to everything after it.

use super::{CoverageMask, PairUncertainty, RayField, transport};
use crate::geometry::TriangulateError;
use crate::geometry::{
    PixelPoint, Ray, RigidTransform, Triangulation, midpoint_by_shifts, triangulate_pair,
    triangulate_rays,
};
use nalgebra::{Matrix3, Matrix3x2, Matrix3x4, Matrix4, Vector3};
use serde::{Deserialize, Serialize};

/// One calibrated camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibratedCamera {
    /// Unique in the rig.
    pub name: String,
    /// What each pixel sees, camera frame.
    pub field: RayField,
    /// Where the field is backed by observations.
    pub coverage: CoverageMask,
    /// Where the camera is. The rig frame is the board at the datum pose.
    pub rig_from_camera: RigidTransform,
}

/// One or more calibrated cameras in the rig frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// In the dataset's order.
    pub cameras: Vec<CalibratedCamera>,
    /// The pose whose board frame is the rig frame.
    pub datum_pose: usize,
    /// How well pairs of cameras know their rays, the first camera with each other; empty if that
    /// was not estimated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub uncertainty: Vec<PairUncertainty>,
}

/// Why a match has no point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MeasureError {
    /// A pixel lies outside its camera's calibrated area.
    #[error("a pixel lies outside the calibrated area of camera {camera_idx}")]
    Outside {
        /// Index of the camera.
        camera_idx: usize,
    },
    /// The rays do not meet in front of the cameras.
    #[error(transparent)]
    Triangulate(#[from] TriangulateError),
}

impl CalibratedCamera {
    /// What the pixel sees, rig frame; `None` outside the calibrated area.
    pub fn ray_in_rig(&self, pixel: PixelPoint) -> Option<Ray> {
        self.coverage
            .contains(pixel)
            .then(|| self.field.ray(pixel).transformed(&self.rig_from_camera))
    }

    /// The point at a distance along the pixel's ray, rig frame, mm, and the pixel at which another
    /// camera sees it; `None` if either pixel is not calibrated.
    pub fn seen_by(
        &self,
        other: &Self,
        pixel: PixelPoint,
        distance_mm: f64,
    ) -> Option<(Vector3<f64>, PixelPoint)> {
        let ray = self.ray_in_rig(pixel)?;
        let point_in_rig = ray.origin_mm + ray.direction.normalize() * distance_mm;
        let point_in_other = other.rig_from_camera.inverse().point(&point_in_rig);
        let seen = other.field.project(&point_in_other)?;
        other
            .coverage
            .contains(seen)
            .then_some((point_in_rig, seen))
    }

    /// How the pixel's ray moves across itself at a point on it, per px of u and of v (columns):
    /// rig frame, mm/px. The point is given in the rig frame, mm.
    pub fn ray_shift_mm_per_px(
        &self,
        pixel: PixelPoint,
        point_in_rig: &Vector3<f64>,
    ) -> Matrix3x2<f64> {
        let sample = self.field.sample(pixel);
        let point_in_camera = self.rig_from_camera.inverse().point(point_in_rig);
        let local = transport::frame(&sample.s).tr_mul(&point_in_camera);
        // What moves is the point against the ray; the ray moves the other way.
        let by_s = transport::local_point_derivative(&sample.s, &local);
        let shift_along_axes = sample.dm - by_s.fixed_rows::<2>(0) * sample.ds;
        self.rig_from_camera.rotation * transport::across(&sample.s) * shift_along_axes
    }
}

/// Covariance of a triangulated point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointCovariance {
    /// From what the calibration leaves uncertain, rig frame, mm^2.
    pub calibration_mm2: Matrix3<f64>,
    /// From the noise of the measured pixels, mm^2.
    pub noise_mm2: Matrix3<f64>,
}

impl PointCovariance {
    /// Both together, mm^2.
    pub fn total_mm2(&self) -> Matrix3<f64> {
        self.calibration_mm2 + self.noise_mm2
    }
}

impl Rig {
    /// Covariance of the point of two sightings, in either order; `None` if the pair has no
    /// uncertainty, for a pixel without a ray, and for parallel rays.
    ///
    /// `J (C + noise I) J^T` with the derivative J of the midpoint by the four pixel coordinates
    /// and the pair's covariance C of pixels (METHOD 5).
    pub fn pair_covariance(&self, sightings: [(usize, PixelPoint); 2]) -> Option<PointCovariance> {
        let pair = |first: usize, second: usize| {
            self.uncertainty
                .iter()
                .find(|u| (u.first, u.second) == (first, second))
        };
        let [a, b] = sightings;
        let (uncertainty, [a, b]) = match pair(a.0, b.0) {
            Some(uncertainty) => (uncertainty, [a, b]),
            None => (pair(b.0, a.0)?, [b, a]),
        };
        let see = |(idx, pixel): (usize, PixelPoint)| {
            let camera = self.cameras.get(idx)?;
            Some((camera, camera.ray_in_rig(pixel)?))
        };
        let ((camera_a, ray_a), (camera_b, ray_b)) = (see(a)?, see(b)?);
        let point = triangulate_pair(&ray_a, &ray_b).ok()?.point_mm;
        let (by_a, by_b) = midpoint_by_shifts(&ray_a, &ray_b)?;
        // Columns: what a pixel of each coordinate does to the point.
        let mut by_pixels = Matrix3x4::zeros();
        by_pixels
            .fixed_columns_mut::<2>(0)
            .copy_from(&(by_a * camera_a.ray_shift_mm_per_px(a.1, &point)));
        by_pixels
            .fixed_columns_mut::<2>(2)
            .copy_from(&(by_b * camera_b.ray_shift_mm_per_px(b.1, &point)));
        let carry = |px2: Matrix4<f64>| by_pixels * px2 * by_pixels.transpose();
        Some(PointCovariance {
            calibration_mm2: carry(uncertainty.calibration_at(a.1)),
            noise_mm2: carry(Matrix4::identity() * uncertainty.noise_px2),
        })
    }

    /// The index of the camera with this name.
    pub fn camera_idx(&self, name: &str) -> Option<usize> {
        self.cameras.iter().position(|camera| camera.name == name)
    }

    /// The point seen at `(camera_idx, pixel)` by two or more cameras, rig frame, mm.
    ///
    /// # Errors
    /// [`MeasureError::Outside`] for the first pixel without a ray (an index without a camera
    /// counts as one), else what the rays give.
    pub fn triangulate(
        &self,
        sightings: &[(usize, PixelPoint)],
    ) -> Result<Triangulation, MeasureError> {
        let rays = sightings
            .iter()
            .map(|&(camera_idx, pixel)| {
                self.cameras
                    .get(camera_idx)
                    .and_then(|camera| camera.ray_in_rig(pixel))
                    .ok_or(MeasureError::Outside { camera_idx })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(triangulate_rays(&rays)?)
    }
}
