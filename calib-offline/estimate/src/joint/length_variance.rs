//! How uncertain a length between two measured points is, both ends together (METHOD 5.1).

use super::covariance::{Node, node, points_by_predictions};
use super::error::EstimateError;
use super::estimate::Estimate;
use super::fit::Fit;
use crate::adjust::equations::covariance::sighting_covariance;
use crate::adjust::equations::normal_equations::NormalEquations;
use crate::adjust::equations::schur_complement::SchurComplement;
use crate::adjust::model::Layout;
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use nalgebra::{DMatrix, RowSVector, SMatrix};

/// Lengths whose covariance is made at once: what they share is small, and so is the matrix.
const LENGTHS_AT_ONCE: usize = 8;
/// Standard deviation of the coefficients of a shape that counts as known, mm: a thousandth of what any
/// recording finds.
const KNOWN_SHAPE_SD_MM: f64 = 1e-6;

/// The two ends of a length, each with the camera index and pixel of its two sightings.
pub type Ends = [[(usize, PixelPoint); 2]; 2];

/// Variance of a length by what makes it up, mm^2. The parts are independent: they add up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthVariance {
    /// The length, mm.
    pub length_mm: f64,
    /// From what the calibration leaves open, were the board's shape known.
    pub calibration_mm2: f64,
    /// From what the calibration leaves open of the board's shape.
    pub board_shape_mm2: f64,
    /// From noise of the pixels of 1 px per coordinate, all independent.
    pub per_px2: f64,
    /// What the two parts of the calibration would be, if those of the two ends were independent.
    pub if_independent_mm2: f64,
}

/// Equations of a fit, factorized.
type Factorized = (Layout, NormalEquations, SchurComplement);

impl Estimate {
    /// Variance of lengths from the joint covariance of the four pixels at which both ends are seen;
    /// `None` where an end has no point. `rig` is that of [`Estimate::rig`].
    ///
    /// A rigid motion changes no length, so none is taken out. With the derivative g of the length by
    /// the predictions of its ends and their covariance C, the calibration's part is `g C g^T`. That of the
    /// board's shape is what it loses when the shape is known (the law of total variance).
    ///
    /// Cost: two assemblies of the equations, and eight solutions per length.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn length_variances(
        &self,
        rig: &Rig,
        lengths: &[Ends],
    ) -> Result<Vec<Option<LengthVariance>>, EstimateError> {
        let equations = |sd_mm: f64| -> Result<Factorized, EstimateError> {
            let mut fit: Fit = self.fit.clone();
            fit.board_shape_sd_mm = sd_mm;
            fit.equations(&self.observations)
        };
        let open = equations(self.fit.board_shape_sd_mm)?;
        let known = equations(self.fit.board_shape_sd_mm.min(KNOWN_SHAPE_SD_MM))?;
        let forms: Vec<Option<Form>> = lengths.iter().map(|ends| Form::new(rig, ends)).collect();
        let measured: Vec<&Form> = forms.iter().flatten().collect();
        let mut parts = Vec::with_capacity(measured.len());
        for some in measured.chunks(LENGTHS_AT_ONCE) {
            let with_shape = self.calibration_parts(&open, some);
            let without = self.calibration_parts(&known, some);
            parts.extend(with_shape.into_iter().zip(without));
        }
        let mut parts = parts.into_iter();
        Ok(forms
            .into_iter()
            .map(|form| {
                let form = form?;
                let (open, known) = parts.next()?;
                let (open, known) = (open?, known?);
                Some(LengthVariance {
                    length_mm: form.length_mm,
                    calibration_mm2: known.together_mm2,
                    // Round-off may leave less than nothing.
                    board_shape_mm2: (open.together_mm2 - known.together_mm2).max(0.0),
                    per_px2: form.by_predictions.norm_squared(),
                    if_independent_mm2: open.apart_mm2,
                })
            })
            .collect())
    }

    /// Variance of a pixel coordinate of the corners that were not rejected, px^2.
    pub fn pixel_variance_px2(&self) -> f64 {
        self.fit.pixel_variance_px2(&self.observations)
    }

    fn calibration_parts(
        &self,
        (layout, equations, reduced): &Factorized,
        lengths: &[&Form],
    ) -> Vec<Option<CalibrationPart>> {
        let sightings: Vec<_> = lengths
            .iter()
            .flat_map(|form| form.nodes.iter().flatten().map(|node| node.sighting))
            .collect();
        let covariance = sighting_covariance(
            &self.model,
            layout,
            equations,
            reduced,
            self.model.frame_pose(),
            &sightings,
        );
        let Some((covariance, _)) = covariance else {
            return vec![None; lengths.len()];
        };
        let parts = lengths.iter().enumerate();
        parts
            .map(|(k, form)| Some(form.calibration_part(&covariance, 8 * k)))
            .collect()
    }
}

/// The calibration's part of a length's variance, mm^2.
#[derive(Debug, Clone, Copy)]
struct CalibrationPart {
    together_mm2: f64,
    apart_mm2: f64,
}

/// A length as a linear form of the predictions of its ends.
struct Form {
    nodes: [[Node; 2]; 2],
    length_mm: f64,
    /// Per px of each prediction: end, camera, coordinate.
    by_predictions: RowSVector<f64, 8>,
}

impl Form {
    /// `None` where an end has no point, or both have the same.
    fn new(rig: &Rig, ends: &Ends) -> Option<Self> {
        let points = [
            rig.triangulate(&ends[0]).ok()?.point_mm,
            rig.triangulate(&ends[1]).ok()?.point_mm,
        ];
        let nodes = [0, 1].map(|k| {
            ends[k].map(|(camera, pixel)| node(camera, &rig.cameras[camera], pixel, points[k]))
        });
        let between = points[1] - points[0];
        let length_mm = between.norm();
        let along = between.try_normalize(f64::MIN_POSITIVE)?;
        let mut by_points = RowSVector::<f64, 6>::zeros();
        by_points
            .fixed_columns_mut::<3>(0)
            .copy_from(&-along.transpose());
        by_points
            .fixed_columns_mut::<3>(3)
            .copy_from(&along.transpose());
        let to_points: DMatrix<f64> = points_by_predictions(&nodes)?;
        let to_points: SMatrix<f64, 6, 8> = to_points.fixed_view::<6, 8>(0, 0).into_owned();
        Some(Self {
            nodes,
            length_mm,
            by_predictions: by_points * to_points,
        })
    }

    /// From the covariance of predictions, those of this length from a place on.
    fn calibration_part(&self, covariance: &DMatrix<f64>, from: usize) -> CalibrationPart {
        let own = covariance.fixed_view::<8, 8>(from, from).into_owned();
        let mut apart = own;
        apart.fixed_view_mut::<4, 4>(0, 4).fill(0.0);
        apart.fixed_view_mut::<4, 4>(4, 0).fill(0.0);
        let variance = |c: &SMatrix<f64, 8, 8>| {
            (self.by_predictions * c * self.by_predictions.transpose())[0].max(0.0)
        };
        CalibrationPart {
            together_mm2: variance(&own),
            apart_mm2: variance(&apart),
        }
    }
}
