//! Calibrated cameras in one common frame: what an estimate hands to everything after it.

use super::{CoverageMask, PairUncertainty, RayField, transport};
use crate::geometry::TriangulateError;
use crate::geometry::{
    PixelPoint, Ray, RigidTransform, Triangulation, midpoint_by_shifts, triangulate_pair,
    triangulate_rays,
};
use nalgebra::{Matrix3, Matrix3x2, Matrix3x4, Matrix4, Vector3, Vector4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One calibrated camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Rig {
    /// In the dataset's order.
    pub cameras: Vec<CalibratedCamera>,
    /// The pose whose board frame is the rig frame.
    pub datum_pose: usize,
    /// Whether the rig's frame is that of poses known beforehand, or of the file that the rig was imported from, and not the
    /// board at the datum pose.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub frame_is_known: bool,
    /// How well pairs of cameras know their rays, the first camera with each other; empty if that
    /// was not estimated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub uncertainty: Vec<PairUncertainty>,
    /// Standard deviation of a pixel coordinate of matches, if somebody said so, px; else matches are taken to
    /// be as exact as the calibration's corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub match_noise_px: Option<f64>,
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

/// A gap beside what is predicted of it: pixels whose coordinates are off by `s` px give it the variance
/// `calibration_mm2 + s * s * mm2_per_px2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Length of the common perpendicular, mm.
    pub gap_mm: f64,
    /// What the calibration leaves uncertain of it, mm^2.
    pub calibration_mm2: f64,
    /// What noise of one pixel makes of it, mm^2/px^2.
    pub mm2_per_px2: f64,
}

/// Two sightings of a pair with uncertainty, the pair's first camera first.
struct SeenPair<'a> {
    uncertainty: &'a PairUncertainty,
    /// Of the pair's first camera.
    pixel: PixelPoint,
    /// Columns: what a pixel of each coordinate does to the point, mm/px.
    by_pixels: Matrix3x4<f64>,
    gap_mm: f64,
    /// The same of the gap, taken with its sign.
    gap_by_pixels: Vector4<f64>,
}

impl SeenPair<'_> {
    fn calibration_px2(&self) -> Matrix4<f64> {
        self.uncertainty.calibration_at(self.pixel)
    }
}

impl Rig {
    /// What the rig's frame is, in words.
    pub fn frame(&self) -> String {
        if self.frame_is_known {
            "frame that was given".to_owned()
        } else {
            format!("board at pose {}", self.datum_pose)
        }
    }

    /// Covariance of the point of two sightings, in either order; `None` if the pair has no
    /// uncertainty, for a pixel without a ray, and for parallel rays.
    ///
    /// `J (C + noise I) J^T` with the derivative J of the midpoint by the four pixel coordinates
    /// and the pair's covariance C of pixels (METHOD 5); the noise is that of matches where it was stated, else that
    /// of the corners.
    pub fn pair_covariance(&self, sightings: [(usize, PixelPoint); 2]) -> Option<PointCovariance> {
        let seen = self.seen_pair(sightings)?;
        let noise_px2 = self
            .match_noise_px
            .map_or(seen.uncertainty.noise_px2, |px| px * px);
        let carry = |px2: Matrix4<f64>| seen.by_pixels * px2 * seen.by_pixels.transpose();
        Some(PointCovariance {
            calibration_mm2: carry(seen.calibration_px2()),
            noise_mm2: carry(Matrix4::identity() * noise_px2),
        })
    }

    /// The gap of two sightings and what is predicted of it; `None` as in [`pair_covariance`](Self::pair_covariance).
    pub fn pair_gap(&self, sightings: [(usize, PixelPoint); 2]) -> Option<Gap> {
        let seen = self.seen_pair(sightings)?;
        let by_pixels = &seen.gap_by_pixels;
        Some(Gap {
            gap_mm: seen.gap_mm,
            calibration_mm2: by_pixels.dot(&(seen.calibration_px2() * by_pixels)),
            mm2_per_px2: by_pixels.norm_squared(),
        })
    }

    /// How the point and the gap of two sightings move with their pixels.
    fn seen_pair(&self, sightings: [(usize, PixelPoint); 2]) -> Option<SeenPair<'_>> {
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
        let found = triangulate_pair(&ray_a, &ray_b).ok()?;
        let (by_a, by_b) = midpoint_by_shifts(&ray_a, &ray_b)?;
        let shift_a = camera_a.ray_shift_mm_per_px(a.1, &found.point_mm);
        let shift_b = camera_b.ray_shift_mm_per_px(b.1, &found.point_mm);
        let mut by_pixels = Matrix3x4::zeros();
        by_pixels
            .fixed_columns_mut::<2>(0)
            .copy_from(&(by_a * shift_a));
        by_pixels
            .fixed_columns_mut::<2>(2)
            .copy_from(&(by_b * shift_b));
        // The gap, with its sign, runs from the first ray to the second along the common normal.
        let normal = ray_a.direction.cross(&ray_b.direction).normalize();
        let (away, toward) = (shift_a.tr_mul(&normal), shift_b.tr_mul(&normal));
        Some(SeenPair {
            uncertainty,
            pixel: a.1,
            by_pixels,
            gap_mm: found.gap_mm,
            gap_by_pixels: Vector4::new(-away.x, -away.y, toward.x, toward.y),
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
