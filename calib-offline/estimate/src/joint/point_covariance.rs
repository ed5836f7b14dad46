//! How uncertain the shape of a cloud of measured points is, all points together; and that of a
//! bundle of rays, for a camera alone.

use super::covariance::{RIGID_RANK_SHARE, node, points_by_predictions};
use super::error::EstimateError;
use super::estimate::Estimate;
use crate::adjust::Model;
use crate::adjust::equations::covariance::sighting_covariance;
use crate::adjust::equations::normal_equations::NormalEquations;
use crate::adjust::equations::schur_complement::SchurComplement;
use crate::adjust::model::Layout;
use calib_rays::field::{Rig, transport};
use calib_rays::geometry::PixelPoint;
use calib_rays::geometry::so3::skew;
use calib_rays::numerics::SingularValues;
use nalgebra::{DMatrix, Matrix2x6, Matrix3, Matrix3x2, Vector3};

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
        let found = self.fit.equations(&self.observations)?;
        Ok(shape_covariance(&self.model, &found, rig, matches))
    }

    /// Covariance of where the rays of one camera pass at a distance from it, from what the
    /// calibration leaves uncertain, the best rigid motion of the camera taken out: `2 n` rows and
    /// columns, along the two axes across each ray (`transport::across`), mm^2.
    ///
    /// `None` if the pixels are too few to take a motion out.
    ///
    /// Cost: one assembly of the equations, and a dense product of `2 n` square matrices.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn ray_covariance(
        &mut self,
        rig: &Rig,
        camera_idx: usize,
        pixels: &[PixelPoint],
        distance_mm: f64,
    ) -> Result<Option<DMatrix<f64>>, EstimateError> {
        let (layout, equations, reduced) = self.fit.equations(&self.observations)?;
        let covariance = || {
            let camera = rig.cameras.get(camera_idx)?;
            let nodes: Vec<_> = pixels
                .iter()
                .map(|pixel| {
                    let ray = camera
                        .field
                        .ray(*pixel)
                        .transformed(&camera.rig_from_camera);
                    let point = ray.origin_mm + ray.direction.normalize() * distance_mm;
                    node(camera_idx, camera, *pixel, point)
                })
                .collect();
            let sightings: Vec<_> = nodes.iter().map(|node| node.sighting).collect();
            let (predictions, _) = sighting_covariance(
                &self.model,
                &layout,
                &equations,
                &reduced,
                self.model.frame_pose(),
                &sightings,
            )?;
            let mut to_mm = DMatrix::zeros(predictions.nrows(), predictions.ncols());
            let mut motions = DMatrix::zeros(predictions.nrows(), 6);
            for (k, node) in nodes.iter().enumerate() {
                let s = camera.field.sample(node.sighting.pixel).s;
                let axes = camera.rig_from_camera.rotation * transport::across(&s);
                to_mm
                    .view_mut((2 * k, 2 * k), (2, 2))
                    .copy_from(&axes.tr_mul(&node.mm_per_px));
                let across = across_motions(&axes, &node.sighting.point_in_board);
                motions.view_mut((2 * k, 0), (2, 6)).copy_from(&across);
            }
            let shape = without_motions(&motions)? * to_mm;
            Some(&shape * predictions * shape.transpose())
        };
        Ok(covariance())
    }
}

/// [`Estimate::point_covariance`] of a model whose equations are at hand.
pub(super) fn shape_covariance(
    model: &Model,
    (layout, equations, reduced): &(Layout, NormalEquations, SchurComplement),
    rig: &Rig,
    matches: &[[(usize, PixelPoint); 2]],
) -> Option<DMatrix<f64>> {
    let mut points = Vec::new();
    let mut nodes = Vec::new();
    for sightings in matches {
        let point = rig.triangulate(sightings).ok()?.point_mm;
        nodes.push(
            sightings.map(|(camera, pixel)| node(camera, &rig.cameras[camera], pixel, point)),
        );
        points.push(point);
    }
    let sightings: Vec<_> = nodes.iter().flatten().map(|node| node.sighting).collect();
    let (predictions, _) = sighting_covariance(
        model,
        layout,
        equations,
        reduced,
        model.frame_pose(),
        &sightings,
    )?;
    let to_points = points_by_predictions(&nodes)?;
    let shape = without_motions(&rigid_motions(&points))? * to_points;
    Some(&shape * predictions * shape.transpose())
}

/// What a rigid motion (rotation vector, then translation) does to a point, along two axes.
pub fn across_motions(axes: &Matrix3x2<f64>, point: &Vector3<f64>) -> Matrix2x6<f64> {
    let mut across = Matrix2x6::zeros();
    across
        .fixed_columns_mut::<3>(0)
        .copy_from(&(-axes.tr_mul(&skew(point))));
    across
        .fixed_columns_mut::<3>(3)
        .copy_from(&axes.transpose());
    across
}

/// What a rigid motion (rotation vector about the points' middle, then translation) does to
/// points: three rows each.
fn rigid_motions(points: &[Vector3<f64>]) -> DMatrix<f64> {
    let middle = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let mut motions = DMatrix::zeros(3 * points.len(), 6);
    for (k, point) in points.iter().enumerate() {
        motions
            .view_mut((3 * k, 0), (3, 3))
            .copy_from(&-skew(&(point - middle)));
        motions
            .view_mut((3 * k, 3), (3, 3))
            .copy_from(&Matrix3::identity());
    }
    motions
}

/// The projector that takes the best of some motions (columns) out, which may depend on each other;
/// `None` of no rows.
pub fn without_motions(motions: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let count = motions.nrows();
    let svd = SingularValues::new(motions.clone())?;
    let left = svd.left();
    let moved = left.columns(0, svd.rank(RIGID_RANK_SHARE));
    (count > 0).then(|| DMatrix::identity(count, count) - moved * moved.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three points on a line have five motions in place of six. With nalgebra 0.35's
    /// pseudo-inverse, the projector left 8e-3 of the motions of these, and its square differed from
    /// it by 4e-3.
    #[test]
    fn motions_of_points_on_a_line_are_taken_out() {
        let points = [
            [55.2, -76.0, -19.2],
            [62.45, -73.5, -18.45],
            [47.95, -78.5, -19.95],
        ]
        .map(Vector3::from);
        let motions = rigid_motions(&points);
        let projector = without_motions(&motions).unwrap();
        // Nine rows, each the sum of nine rounded products.
        let round_off = 81.0 * f64::EPSILON;
        assert!((&projector * &motions).amax() < round_off * motions.amax());
        assert!((&projector * &projector - &projector).amax() < round_off);
        assert!((projector.trace() - 4.0).abs() < round_off);
        assert!(without_motions(&DMatrix::zeros(0, 6)).is_none());
    }
}
