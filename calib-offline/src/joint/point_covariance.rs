//! How uncertain the shape of a cloud of measured points is, all points together.

use super::covariance::{node, points_by_predictions};
use super::estimate::{Estimate, EstimateError};
use crate::adjust::covariance::sighting_covariance;
use crate::field::Rig;
use crate::geometry::PixelPoint;
use crate::geometry::so3::skew;
use nalgebra::{DMatrix, Matrix3, Vector3};

impl Estimate {
    /// Covariance of the points of matches from what the calibration leaves uncertain, the pixels
    /// taken as exact and the best rigid motion of all points taken out: `3 n` rows and columns,
    /// x, y, z of each point in the frame of `rig` (which is that of [`Estimate::rig`]), mm^2.
    ///
    /// A match is the camera index and pixel of two sightings. `None` if one has no point.
    ///
    /// Cost: one assembly of the equations, and a dense product of `4 n` square matrices.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn point_covariance(
        &mut self,
        rig: &Rig,
        matches: &[[(usize, PixelPoint); 2]],
    ) -> Result<Option<DMatrix<f64>>, EstimateError> {
        let (layout, equations, reduced) = self.fit.equations(&self.observations)?;
        let covariance = || {
            let mut points = Vec::new();
            let mut nodes = Vec::new();
            for sightings in matches {
                let point = rig.triangulate(sightings).ok()?.point_mm;
                nodes.push(
                    sightings
                        .map(|(camera, pixel)| node(camera, &rig.cameras[camera], pixel, point)),
                );
                points.push(point);
            }
            let sightings: Vec<_> = nodes.iter().flatten().map(|node| node.sighting).collect();
            // The datum is the first pose.
            let (predictions, _) =
                sighting_covariance(&self.model, &layout, &equations, &reduced, 0, &sightings)?;
            let to_points = points_by_predictions(&nodes)?;
            let shape = without_rigid_motion(&points)? * to_points;
            Some(&shape * predictions * shape.transpose())
        };
        Ok(covariance())
    }
}

/// Takes the best rigid motion out of small displacements of points; `None` if the points are too
/// few or on a line.
fn without_rigid_motion(points: &[Vector3<f64>]) -> Option<DMatrix<f64>> {
    let count = 3 * points.len();
    let middle = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let mut motions = DMatrix::zeros(count, 6);
    for (k, point) in points.iter().enumerate() {
        motions
            .view_mut((3 * k, 0), (3, 3))
            .copy_from(&-skew(&(point - middle)));
        motions
            .view_mut((3 * k, 3), (3, 3))
            .copy_from(&Matrix3::identity());
    }
    let normal = motions.tr_mul(&motions).cholesky()?;
    let best = normal.solve(&motions.transpose());
    Some(DMatrix::identity(count, count) - motions * best)
}
