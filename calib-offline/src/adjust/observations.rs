//! What was seen, arranged for adjustment: one block per view, with everything that does not
//! change while parameters move computed once.

use crate::board::BoardSpec;
use crate::dataset::View;
use crate::field::polynomial::{self, Polynomial};
use crate::field::spline::AxisWeights;
use crate::field::{FieldSample, RayField};
use crate::geometry::{PixelPoint, SensorSize};
use nalgebra::{DMatrix, Matrix2, RowVector2, Vector2, Vector3};

/// All views offered to an adjustment.
#[derive(Debug, Clone)]
pub struct Observations {
    /// The board.
    pub board: BoardSpec,
    /// Sensor per camera.
    pub sensors: Vec<SensorSize>,
    /// Numbers of the poses, rising; a pose's index here is its index everywhere in `adjust`.
    /// A number stands here once per instant: twice if the cameras' views of it do not belong
    /// together.
    pub poses: Vec<usize>,
    /// One block per view, in (camera, pose) order.
    pub views: Vec<ViewBlock>,
}

/// The corners that one camera saw of one pose.
#[derive(Debug, Clone)]
pub struct ViewBlock {
    /// Index of the camera.
    pub camera_idx: usize,
    /// Index into [`Observations::poses`].
    pub pose_idx: usize,
    /// The corners.
    pub corners: Vec<ObservedCorner>,
}

/// One corner of one view.
#[derive(Debug, Clone, Copy)]
pub struct ObservedCorner {
    /// Row on the board.
    pub row: usize,
    /// Column on the board.
    pub col: usize,
    /// Nominal position, board frame, mm.
    pub point_in_board: Vector3<f64>,
    /// Where it was seen.
    pub pixel: PixelPoint,
    /// Inverse variance relative to the typical corner of the dataset.
    pub relative_weight: f64,
}

impl Observations {
    /// Arranges views. `sensors` are those of all cameras, whether they have views or not.
    pub fn new(board: BoardSpec, sensors: Vec<SensorSize>, views: &[View]) -> Self {
        let mut poses: Vec<usize> = views.iter().map(|view| view.pose).collect();
        poses.sort_unstable();
        poses.dedup();
        let typical_sigma_px = median_sigma_px(views);
        let mut blocks: Vec<ViewBlock> = views
            .iter()
            .filter_map(|view| {
                let pose_idx = poses.binary_search(&view.pose).ok()?;
                let corners = view
                    .corners
                    .iter()
                    .map(|corner| ObservedCorner {
                        row: corner.row,
                        col: corner.col,
                        point_in_board: board.corner_in_board(corner.row, corner.col),
                        pixel: corner.pixel,
                        relative_weight: corner
                            .sigma_px
                            .map_or(1.0, |sigma_px| (typical_sigma_px / sigma_px).powi(2)),
                    })
                    .collect();
                Some(ViewBlock {
                    camera_idx: view.camera_idx,
                    pose_idx,
                    corners,
                })
            })
            .collect();
        blocks.sort_by_key(|block| (block.camera_idx, block.pose_idx));
        Self {
            board,
            sensors,
            poses,
            views: blocks,
        }
    }

    /// Number of corners in all views.
    pub fn corner_count(&self) -> usize {
        self.views.iter().map(|view| view.corners.len()).sum()
    }

    /// The views of some poses only, with poses renumbered.
    pub fn with_poses(&self, keep: impl Fn(usize) -> bool) -> Self {
        self.with_pose_indices(|pose_idx| keep(self.poses[pose_idx]))
    }

    /// The views of the poses with some indices only, with poses renumbered.
    pub fn with_pose_indices(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.poses.len()).filter(|idx| keep(*idx)).collect();
        let views = self
            .views
            .iter()
            .filter_map(|view| {
                let pose_idx = kept.binary_search(&view.pose_idx).ok()?;
                Some(ViewBlock {
                    pose_idx,
                    ..view.clone()
                })
            })
            .collect();
        Self {
            board: self.board,
            sensors: self.sensors.clone(),
            poses: kept.iter().map(|idx| self.poses[*idx]).collect(),
            views,
        }
    }

    /// The views of one camera only, as camera 0; poses it did not see are dropped.
    pub fn of_camera(&self, camera_idx: usize) -> Self {
        let mut seen = vec![false; self.poses.len()];
        for view in self.views.iter().filter(|v| v.camera_idx == camera_idx) {
            seen[view.pose_idx] = true;
        }
        let mut selected = self.with_pose_indices(|pose_idx| seen[pose_idx]);
        selected.views.retain(|view| view.camera_idx == camera_idx);
        for view in &mut selected.views {
            view.camera_idx = 0;
        }
        selected.sensors = vec![self.sensors[camera_idx]];
        selected
    }
}

/// Median of the corners' own standard deviations, px; 1 if none has one.
fn median_sigma_px(views: &[View]) -> f64 {
    let mut sigmas: Vec<f64> = views
        .iter()
        .flat_map(|view| view.corners.iter().filter_map(|corner| corner.sigma_px))
        .collect();
    sigmas.sort_by(f64::total_cmp);
    sigmas.get(sigmas.len() / 2).copied().unwrap_or(1.0)
}

/// The values of the fixed functions at the corners of one view: base lens, Legendre products and
/// the weights of the spline's knots.
#[derive(Debug, Clone)]
pub struct ViewBasis {
    /// Base lens at each corner: half-angle vector and derivative per px.
    pub base: Vec<(Vector2<f64>, Matrix2<f64>)>,
    /// Products of the highest degree in use, one row per corner; those of lower degree come
    /// first.
    pub products: DMatrix<f64>,
    /// Their derivatives by u, 1/px.
    pub products_du: DMatrix<f64>,
    /// Their derivatives by v, 1/px.
    pub products_dv: DMatrix<f64>,
    /// Weights along u and v at each corner; empty without a spline.
    pub knots: Vec<(AxisWeights, AxisWeights)>,
}

impl ViewBasis {
    /// Evaluates the fixed functions of a field at the corners of a view.
    pub fn new(view: &ViewBlock, field: &RayField) -> Self {
        let degree = field
            .offset
            .as_ref()
            .map_or(0, |offset| offset.polynomial.degree)
            .max(field.direction.polynomial.degree);
        let (n, k) = (view.corners.len(), polynomial::term_count(degree));
        let mut basis = Self {
            base: Vec::with_capacity(n),
            products: DMatrix::zeros(n, k),
            products_du: DMatrix::zeros(n, k),
            products_dv: DMatrix::zeros(n, k),
            knots: Vec::new(),
        };
        let center = field.sensor.center();
        let mut row = Vec::with_capacity(k);
        for (r, corner) in view.corners.iter().enumerate() {
            let offset = Vector2::new(corner.pixel.u - center.u, corner.pixel.v - center.v);
            basis.base.push(field.base.evaluate(&offset));
            polynomial::basis(field.sensor, degree, corner.pixel, &mut row);
            for (c, [value, du, dv]) in row.iter().enumerate() {
                basis.products[(r, c)] = *value;
                basis.products_du[(r, c)] = *du;
                basis.products_dv[(r, c)] = *dv;
            }
        }
        if let Some(spline) = &field.direction.spline {
            basis.knots = view
                .corners
                .iter()
                .map(|corner| {
                    (
                        spline.grid.weights_u(corner.pixel.u),
                        spline.grid.weights_v(corner.pixel.v),
                    )
                })
                .collect();
        }
        basis
    }

    /// The field's numbers at a corner.
    pub fn sample(&self, field: &RayField, corner_idx: usize) -> FieldSample {
        let (mut s, mut ds) = self.base[corner_idx];
        self.add_polynomial(&field.direction.polynomial, corner_idx, &mut s, &mut ds);
        if let (Some(spline), Some((u, v))) = (&field.direction.spline, self.knots.get(corner_idx))
        {
            let (value, derivative) = spline.weighted(u, v);
            s += value;
            ds += derivative;
        }
        let (mut m_mm, mut dm) = (Vector2::zeros(), Matrix2::zeros());
        if let Some(offset) = &field.offset {
            self.add_polynomial(&offset.polynomial, corner_idx, &mut m_mm, &mut dm);
        }
        FieldSample { s, ds, m_mm, dm }
    }

    fn add_polynomial(
        &self,
        polynomial: &Polynomial,
        corner_idx: usize,
        value: &mut Vector2<f64>,
        derivative: &mut Matrix2<f64>,
    ) {
        for (k, c) in polynomial.coefficients.iter().enumerate() {
            *value += c * self.products[(corner_idx, k)];
            *derivative += c * RowVector2::new(
                self.products_du[(corner_idx, k)],
                self.products_dv[(corner_idx, k)],
            );
        }
    }
}
