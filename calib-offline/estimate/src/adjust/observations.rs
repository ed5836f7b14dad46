//! What was seen, arranged for adjustment: one block per view, with everything that does not
//! change while parameters move computed once.

use calib_rays::board::BoardSpec;
use calib_rays::field::polynomial::{self, AxisValues, Polynomial};
use calib_rays::field::spline::AxisWeights;
use calib_rays::field::{BaseLens, CoverageMask, FieldSample, RayField};
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::numerics::median;
use calib_rays::observed::{Corner, KnownPose, View};
use nalgebra::{DMatrix, Matrix2, Vector2, Vector3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Corners that are predicted farther away are outliers and keep their place.
const FARTHEST_ANCHOR_PX: f64 = 3.0;
/// Standard deviation of each coefficient of a board's shape before anything is seen, mm, where nobody
/// says how flat the board is.
pub const BOARD_SHAPE_SD_MM: f64 = 0.1;
/// A board that is said to be flatter is taken to be as flat as this, mm: no measurement sees it.
const FLATTEST_MM: f64 = 1e-6;

/// All views offered to an adjustment.
#[derive(Debug, Clone)]
pub struct Observations {
    /// The board.
    pub board: BoardSpec,
    /// Standard deviation of each coefficient of its shape before anything is seen, mm.
    pub board_shape_sd_mm: f64,
    /// Poses that are known beforehand, by number.
    pub known_poses: BTreeMap<usize, KnownPose>,
    /// Per camera: whether its rays are declared to meet in one point, whatever the data ask for; empty where
    /// nothing is declared.
    pub declared_central: Vec<bool>,
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
    /// Where it was seen from the pixel at which its residual is taken, px: zero at first.
    pub beyond_px: Vector2<f64>,
    /// Inverse variance relative to the typical corner of the dataset.
    pub relative_weight: f64,
}

impl ObservedCorner {
    /// As a dataset has it.
    pub fn labelled(&self) -> Corner {
        Corner {
            row: self.row,
            col: self.col,
            pixel: self.pixel,
            sigma_px: None,
        }
    }
}

impl Observations {
    /// Arranges views. `sensors` are those of all cameras, whether they have views or not.
    pub fn new(board: BoardSpec, sensors: Vec<SensorSize>, views: &[View]) -> Self {
        let mut poses: Vec<usize> = views.iter().map(|view| view.pose).collect();
        poses.sort_unstable();
        poses.dedup();
        // If no corner has a standard deviation of its own, nothing is asked of this one.
        let corners = views.iter().flat_map(|view| &view.corners);
        let typical_sigma_px = median(corners.filter_map(|c| c.sigma_px)).unwrap_or(1.0);
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
                        beyond_px: Vector2::zeros(),
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
            board_shape_sd_mm: BOARD_SHAPE_SD_MM,
            known_poses: BTreeMap::new(),
            declared_central: Vec::new(),
            sensors,
            poses,
            views: blocks,
        }
    }

    /// The same with residuals taken where a model sees the corners: at the observed pixels without
    /// its `residuals` (observed minus predicted, px). There the derivative that a residual leaves
    /// out is multiplied by nothing (METHOD 2.2).
    pub fn anchored(&self, residuals: &[Vec<Option<Vector2<f64>>>]) -> Self {
        let mut anchored = self.clone();
        for (view, residuals) in anchored.views.iter_mut().zip(residuals) {
            for (corner, residual) in view.corners.iter_mut().zip(residuals) {
                // An outlier's prediction may be anywhere.
                let near = residual.filter(|r| r.norm() < FARTHEST_ANCHOR_PX);
                let to = near.unwrap_or_default();
                let seen = Vector2::new(corner.pixel.u, corner.pixel.v) + corner.beyond_px;
                corner.pixel = PixelPoint::new(seen.x - to.x, seen.y - to.y);
                corner.beyond_px = to;
            }
        }
        anchored
    }

    /// The same of a board whose flatness is known, if it is: standard deviation of each coefficient of
    /// its shape, mm.
    #[must_use]
    pub fn with_flatness(mut self, sd_mm: Option<f64>) -> Self {
        if let Some(sd_mm) = sd_mm {
            self.board_shape_sd_mm = sd_mm.max(FLATTEST_MM);
        }
        self
    }

    /// The same of cameras of which some are declared to be central.
    #[must_use]
    pub fn with_declared_central(mut self, declared: Vec<bool>) -> Self {
        self.declared_central = declared;
        self
    }

    /// Whether a camera is declared to be central.
    pub fn is_declared_central(&self, camera_idx: usize) -> bool {
        self.declared_central
            .get(camera_idx)
            .copied()
            .unwrap_or(false)
    }

    /// The same of poses of which some are known beforehand, by number.
    #[must_use]
    pub fn with_known_poses(mut self, known_poses: BTreeMap<usize, KnownPose>) -> Self {
        self.known_poses = known_poses;
        self.known_poses
            .retain(|pose, _| self.poses.binary_search(pose).is_ok());
        self
    }

    /// What is known beforehand of each pose, by index; of a pose that was split, of its first part.
    pub fn known_of_poses(&self) -> Vec<Option<KnownPose>> {
        let poses = self.poses.iter().enumerate();
        poses
            .map(|(idx, pose)| {
                let is_first = idx == 0 || self.poses[idx - 1] != *pose;
                self.known_poses.get(pose).filter(|_| is_first).copied()
            })
            .collect()
    }

    /// The same with all poses that are known as one: their points where they stood, in the frame of the known
    /// poses, under the number of the first. Several known places of a flat target are one solid target.
    pub fn with_known_as_one(&self) -> Self {
        let Some(first) = self.known_poses.keys().next() else {
            return self.clone();
        };
        let is_known = |pose: &usize| self.known_poses.contains_key(pose);
        let mut poses: Vec<usize> = self
            .poses
            .iter()
            .copied()
            .filter(|p| !is_known(p))
            .collect();
        poses.push(*first);
        poses.sort_unstable();
        poses.dedup();
        let mut views: Vec<ViewBlock> = Vec::new();
        for view in &self.views {
            let number = self.poses[view.pose_idx];
            let known = self.known_poses.get(&number);
            let pose = if known.is_some() { *first } else { number };
            let Ok(pose_idx) = poses.binary_search(&pose) else {
                continue;
            };
            let mut corners = view.corners.clone();
            if let Some(known) = known {
                for corner in &mut corners {
                    corner.point_in_board = known.rig_from_board.point(&corner.point_in_board);
                }
            }
            let same = |other: &ViewBlock| {
                (other.camera_idx, other.pose_idx) == (view.camera_idx, pose_idx)
            };
            match views.iter().position(same) {
                Some(at) => views[at].corners.append(&mut corners),
                None => views.push(ViewBlock {
                    camera_idx: view.camera_idx,
                    pose_idx,
                    corners,
                }),
            }
        }
        views.sort_by_key(|view| (view.camera_idx, view.pose_idx));
        Self {
            poses,
            views,
            ..self.clone()
        }
    }

    /// Number of different poses; one that was split counts once.
    pub fn different_pose_count(&self) -> usize {
        let repeated = self.poses.windows(2).filter(|w| w[0] == w[1]).count();
        self.poses.len() - repeated
    }

    /// Names for cameras that need none: their numbers.
    pub fn numbered_cameras(&self) -> Vec<String> {
        (0..self.sensors.len()).map(|k| k.to_string()).collect()
    }

    /// Number of corners in all views.
    pub fn corner_count(&self) -> usize {
        self.views.iter().map(|view| view.corners.len()).sum()
    }

    /// The calibrated area of a camera: that of its corners that count, which `counts` is asked of
    /// by index of the view and of the corner in it.
    pub fn coverage(
        &self,
        camera_idx: usize,
        counts: impl Fn(usize, usize) -> bool,
    ) -> CoverageMask {
        let views = self.views.iter().enumerate();
        let corners = views
            .filter(|(_, view)| view.camera_idx == camera_idx)
            .flat_map(|(view_idx, view)| {
                let corners = view.corners.iter().enumerate();
                corners.map(move |(corner_idx, corner)| (view_idx, corner_idx, corner.pixel))
            })
            .filter(|(view_idx, corner_idx, _)| counts(*view_idx, *corner_idx))
            .map(|(_, _, pixel)| pixel);
        CoverageMask::from_corners(self.sensors[camera_idx], corners)
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
            board: self.board.clone(),
            board_shape_sd_mm: self.board_shape_sd_mm,
            known_poses: self.known_poses.clone(),
            declared_central: self.declared_central.clone(),
            sensors: self.sensors.clone(),
            poses: kept.iter().map(|idx| self.poses[*idx]).collect(),
            views,
        }
    }

    /// The corners with some labels (row, column) only, of all views.
    pub fn with_labels(&self, keep: impl Fn(usize, usize) -> bool) -> Self {
        let mut selected = self.clone();
        for view in &mut selected.views {
            view.corners.retain(|corner| keep(corner.row, corner.col));
        }
        selected.views.retain(|view| !view.corners.is_empty());
        selected
    }

    /// Whether a single pose may determine everything: points that lie in no plane, or poses that are known.
    pub fn may_be_one_pose(&self) -> bool {
        !self.board.layout.is_grid() || !self.known_poses.is_empty()
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
        selected.declared_central = vec![self.is_declared_central(camera_idx)];
        selected
    }
}

/// The values of the fixed functions at the corners of one view: base lens, Legendre products and
/// the weights of the spline's knots.
#[derive(Debug, Clone)]
pub struct ViewBasis {
    /// Base lens and products; shared by all models that differ in knots only.
    polynomial: Arc<PolynomialBasis>,
    /// Weights along u and v at each corner; empty without a spline.
    pub knots: Vec<(AxisWeights, AxisWeights)>,
}

#[derive(Debug)]
struct PolynomialBasis {
    lens: BaseLens,
    degree: usize,
    /// Base lens at each corner: half-angle vector and derivative per px.
    base: Vec<(Vector2<f64>, Matrix2<f64>)>,
    /// Products of the highest degree in use, one column per corner; those of lower degree come
    /// first.
    products: DMatrix<f64>,
    /// Their derivatives by u, 1/px.
    products_du: DMatrix<f64>,
    /// Their derivatives by v, 1/px.
    products_dv: DMatrix<f64>,
    /// The single polynomials up to twice the degree, for products of products.
    axes: Vec<AxisValues>,
}

impl ViewBasis {
    /// Evaluates the fixed functions of a field at the corners of a view.
    pub fn new(view: &ViewBlock, field: &RayField) -> Self {
        Self {
            polynomial: Arc::new(PolynomialBasis::new(view, field)),
            knots: knots(view, field),
        }
    }

    /// The same for a changed field; what did not change is taken over.
    pub fn of_changed(&self, view: &ViewBlock, field: &RayField) -> Self {
        let known = &self.polynomial;
        if known.lens == field.base && known.degree == highest_degree(field) {
            Self {
                polynomial: Arc::clone(known),
                knots: knots(view, field),
            }
        } else {
            Self::new(view, field)
        }
    }

    /// Legendre products, one column per corner; those of lower degree come first.
    pub fn products(&self) -> &DMatrix<f64> {
        &self.polynomial.products
    }

    /// Highest degree of the products.
    pub fn degree(&self) -> usize {
        self.polynomial.degree
    }

    /// The single polynomials at a corner, up to twice [`Self::degree`].
    pub fn axes(&self, corner_idx: usize) -> &AxisValues {
        &self.polynomial.axes[corner_idx]
    }

    /// The field's numbers at a corner. An adjustment has no spline in its offsets, and none is
    /// looked at.
    pub fn sample(&self, field: &RayField, corner_idx: usize) -> FieldSample {
        let fixed = &*self.polynomial;
        let (mut s, mut ds) = fixed.base[corner_idx];
        let (value, derivative) = fixed.sum(&field.direction.polynomial, corner_idx);
        s += value;
        ds += derivative;
        if let (Some(spline), Some((u, v))) = (&field.direction.spline, self.knots.get(corner_idx))
        {
            let (value, derivative) = spline.weighted(u, v);
            s += value;
            ds += derivative;
        }
        let (m_mm, dm) = field
            .offset
            .as_ref()
            .map_or((Vector2::zeros(), Matrix2::zeros()), |offset| {
                fixed.sum(&offset.polynomial, corner_idx)
            });
        FieldSample { s, ds, m_mm, dm }
    }
}

/// Weights of the spline's knots along u and v at each corner of a view.
fn knots(view: &ViewBlock, field: &RayField) -> Vec<(AxisWeights, AxisWeights)> {
    field
        .direction
        .spline
        .as_ref()
        .map_or_else(Vec::new, |spline| {
            view.corners
                .iter()
                .map(|corner| {
                    (
                        spline.grid.weights_u(corner.pixel.u),
                        spline.grid.weights_v(corner.pixel.v),
                    )
                })
                .collect()
        })
}

fn highest_degree(field: &RayField) -> usize {
    field
        .offset
        .as_ref()
        .map_or(0, |offset| offset.polynomial.degree)
        .max(field.direction.polynomial.degree)
}

impl PolynomialBasis {
    fn new(view: &ViewBlock, field: &RayField) -> Self {
        let degree = highest_degree(field);
        let (n, k) = (view.corners.len(), polynomial::term_count(degree));
        let mut basis = Self {
            lens: field.base,
            degree,
            base: Vec::with_capacity(n),
            products: DMatrix::zeros(k, n),
            products_du: DMatrix::zeros(k, n),
            products_dv: DMatrix::zeros(k, n),
            axes: Vec::with_capacity(n),
        };
        let center = field.sensor.center();
        let mut values = Vec::with_capacity(k);
        for (c, corner) in view.corners.iter().enumerate() {
            let offset = Vector2::new(corner.pixel.u - center.u, corner.pixel.v - center.v);
            basis.base.push(field.base.evaluate(&offset));
            basis.axes.push(polynomial::axis_values(
                field.sensor,
                2 * degree,
                corner.pixel,
            ));
            polynomial::basis(field.sensor, degree, corner.pixel, &mut values);
            for (r, [value, du, dv]) in values.iter().enumerate() {
                basis.products[(r, c)] = *value;
                basis.products_du[(r, c)] = *du;
                basis.products_dv[(r, c)] = *dv;
            }
        }
        basis
    }

    /// A polynomial and its derivative by (u, v) at a corner.
    fn sum(&self, polynomial: &Polynomial, corner_idx: usize) -> (Vector2<f64>, Matrix2<f64>) {
        let columns = [&self.products, &self.products_du, &self.products_dv];
        let [p, du, dv] = columns.map(|m| &m.as_slice()[corner_idx * m.nrows()..][..m.nrows()]);
        let mut sums = [[0.0; 2]; 3];
        for (((c, p), du), dv) in polynomial.coefficients.iter().zip(p).zip(du).zip(dv) {
            for (sum, factor) in sums.iter_mut().zip([p, du, dv]) {
                sum[0] += c.x * factor;
                sum[1] += c.y * factor;
            }
        }
        let [value, du, dv] = sums.map(Vector2::from);
        (value, Matrix2::from_columns(&[du, dv]))
    }
}
