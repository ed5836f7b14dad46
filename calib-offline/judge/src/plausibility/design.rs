//! How well a recording's boards hold a lens, before any fit: the covariance of a lens of nine numbers
//! (focal lengths, principal point, three radial and two tangential terms, as `OpenCV` has them), of the
//! cameras' places and of the boards' poses, from where the boards stand and what was seen of them; and
//! what it does to measured points.
//!
//! The numbers displace pixels, so that the same nine stand for any lens: to first order a perspective
//! lens and a fisheye differ only in where the pixels are. The design is exact, the noise a factor: all
//! results are for corners of 1 px per axis.

use calib_estimate::adjust::residual::{Linearization, linearize};
use calib_rays::field::RayField;
use calib_rays::geometry::{PixelPoint, RigidTransform, so3};
use calib_rays::numerics::SingularValues;
use calib_rays::numerics::arrowhead::{Arrowhead, PoseBlock};
use nalgebra::{
    DMatrix, Matrix2x3, Matrix2x6, Matrix2xX, Matrix3, Matrix3xX, Matrix6, Vector2, Vector3,
    Vector6,
};

/// Numbers of a lens.
const LENS: usize = 9;
/// Numbers of a camera's place.
const PLACE: usize = 6;
/// What a lens may be off by before anything is seen, as a share of half the sensor: wide enough to
/// say nothing, so that what the boards do not determine stays a number.
const PRIOR_SHARE: f64 = 0.2;
/// A singular value this much smaller than the largest is that of a single ray along itself.
const DEPENDENT: f64 = 1e-9;

/// A camera and where it stands; the first one's frame is the rig's.
#[derive(Debug, Clone, Copy)]
pub struct DesignCamera<'a> {
    /// Its rays.
    pub field: &'a RayField,
    /// The identity for the first.
    pub camera_from_rig: RigidTransform,
}

/// What one camera saw of one board: pixels and places on the board, mm.
pub type Seen = (usize, Vec<(PixelPoint, Vector3<f64>)>);

/// The equations of a recording.
#[derive(Debug, Clone)]
pub struct Design<'a> {
    cameras: Vec<DesignCamera<'a>>,
    equations: Arrowhead,
}

impl<'a> Design<'a> {
    /// No board yet.
    pub fn new(cameras: Vec<DesignCamera<'a>>) -> Self {
        let count = cameras.len() * LENS + (cameras.len() - 1) * PLACE;
        let mut equations = Arrowhead::new(count, 0);
        for (idx, camera) in cameras.iter().enumerate() {
            for k in 0..LENS {
                let at = idx * LENS + k;
                equations.shared[(at, at)] = (PRIOR_SHARE * half_px(camera.field)).powi(-2);
            }
        }
        Self { cameras, equations }
    }

    /// Adds a board and what was seen of it.
    pub fn add(&mut self, rig_from_board: &RigidTransform, seen: &[Seen]) {
        let count = self.equations.shared.nrows();
        let mut block = PoseBlock {
            own: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            cross: DMatrix::zeros(count, 6),
        };
        for (camera_idx, corners) in seen {
            let camera = self.cameras[*camera_idx];
            for (pixel, point) in corners {
                let turned = rig_from_board.rotation * point;
                let in_rig = turned + rig_from_board.translation_mm;
                let Some(by_point) = by_point_in_rig(&camera, *pixel, &in_rig) else {
                    continue;
                };
                let by_pose = RigidTransform::by_step(&by_point, &turned);
                let (by_shared, columns) = self.by_shared(*camera_idx, *pixel, &in_rig);
                block.own += by_pose.tr_mul(&by_pose);
                for (a, column) in columns.iter().enumerate() {
                    for (b, other) in columns.iter().enumerate() {
                        self.equations.shared[(*column, *other)] +=
                            by_shared.column(a).dot(&by_shared.column(b));
                    }
                    for k in 0..6 {
                        block.cross[(*column, k)] += by_shared.column(a).dot(&by_pose.column(k));
                    }
                }
            }
        }
        if block.own.cholesky().is_some() {
            self.equations.poses.push(block);
        }
    }

    /// Derivative of a corner's residual by the numbers that all views share, and which they are.
    fn by_shared(
        &self,
        camera_idx: usize,
        pixel: PixelPoint,
        in_rig: &Vector3<f64>,
    ) -> (Matrix2xX<f64>, Vec<usize>) {
        let camera = self.cameras[camera_idx];
        let mut columns: Vec<usize> = (0..LENS).map(|k| camera_idx * LENS + k).collect();
        let lens = displacement(camera.field, pixel);
        if camera_idx == 0 {
            return (Matrix2xX::from_columns(&lens), columns);
        }
        let first = self.cameras.len() * LENS + (camera_idx - 1) * PLACE;
        columns.extend(first..first + PLACE);
        let mut all: Vec<Vector2<f64>> = lens.to_vec();
        let turned = camera.camera_from_rig.rotation * in_rig;
        let sample = camera.field.sample(pixel);
        let place = linearize(&sample, &camera.camera_from_rig.point(in_rig))
            .map_or_else(Matrix2x6::zeros, |l| {
                RigidTransform::by_step(&l.by_point, &turned)
            });
        all.extend(
            place
                .column_iter()
                .map(|column| Vector2::new(column[0], column[1])),
        );
        (Matrix2xX::from_columns(&all), columns)
    }

    /// RMS error of points measured at `points` (rig frame, mm) that the lenses and places leave after
    /// the best rigid placement, mm per px of corner noise. `None` where nothing is determined.
    ///
    /// Points are measured by all cameras that see them; by a single camera across its rays only.
    pub fn error_mm_per_px(&self, points: &[Vector3<f64>]) -> Option<f64> {
        let covariance = self.equations.shared_covariance()?;
        let shared = covariance.nrows();
        let mut moves = DMatrix::zeros(3 * points.len(), shared);
        let mut count = 0;
        let mut placement = DMatrix::zeros(3 * points.len(), 6);
        for point in points {
            let Some((rows, columns)) = self.movement(point) else {
                continue;
            };
            for (a, column) in columns.iter().enumerate() {
                for axis in 0..3 {
                    moves[(3 * count + axis, *column)] = rows[(axis, a)];
                }
            }
            let turn = -so3::skew(point);
            for axis in 0..3 {
                for k in 0..3 {
                    placement[(3 * count + axis, k)] = turn[(axis, k)];
                }
                placement[(3 * count + axis, 3 + axis)] = 1.0;
            }
            count += 1;
        }
        if count < 4 {
            return None;
        }
        let moves = moves.rows(0, 3 * count).into_owned();
        let placement = placement.rows(0, 3 * count).into_owned();
        let basis = placement.qr().q();
        let left = &moves - &basis * basis.tr_mul(&moves);
        let variance = (&left * covariance).component_mul(&left).sum() / count as f64;
        variance.is_finite().then(|| variance.max(0.0).sqrt())
    }

    /// How a measured point moves with the shared numbers, and which they are.
    fn movement(&self, point: &Vector3<f64>) -> Option<(DMatrix<f64>, Vec<usize>)> {
        let mut information = Matrix3::zeros();
        let mut pulls: Vec<(Matrix3xX<f64>, Vec<usize>)> = Vec::new();
        for (idx, camera) in self.cameras.iter().enumerate() {
            let seen = camera.field.project(&camera.camera_from_rig.point(point));
            let Some(pixel) = seen.filter(|pixel| camera.field.sensor.contains(*pixel)) else {
                continue;
            };
            let by_point = by_point_in_rig(camera, pixel, point)?;
            let (by_shared, columns) = self.by_shared(idx, pixel, point);
            information += by_point.tr_mul(&by_point);
            pulls.push((by_point.transpose() * by_shared, columns));
        }
        if pulls.len() < self.cameras.len().min(2) {
            return None;
        }
        // One ray leaves the point free along itself: no movement there.
        let inverse = SingularValues::new(information)?.pseudo_inverse(DEPENDENT);
        let columns: Vec<usize> = pulls.iter().flat_map(|(_, c)| c.clone()).collect();
        let mut rows = DMatrix::zeros(3, columns.len());
        let mut at = 0;
        for (pull, own) in &pulls {
            rows.columns_mut(at, own.len())
                .copy_from(&(-inverse * pull));
            at += own.len();
        }
        Some((rows, columns))
    }

    /// The cameras.
    pub fn cameras(&self) -> &[DesignCamera<'a>] {
        &self.cameras
    }
}

fn half_px(field: &RayField) -> f64 {
    f64::from(field.sensor.width.max(field.sensor.height)) / 2.0
}

/// Derivative of a residual by the corner's place in the rig, px/mm.
fn by_point_in_rig(
    camera: &DesignCamera<'_>,
    pixel: PixelPoint,
    in_rig: &Vector3<f64>,
) -> Option<Matrix2x3<f64>> {
    let sample = camera.field.sample(pixel);
    let Linearization { by_point, .. } = linearize(&sample, &camera.camera_from_rig.point(in_rig))?;
    Some(by_point * camera.camera_from_rig.rotation)
}

/// How each number of the lens displaces a pixel, px per px at half the sensor.
fn displacement(field: &RayField, pixel: PixelPoint) -> [Vector2<f64>; LENS] {
    let center = field.sensor.center();
    let half = half_px(field);
    let p = Vector2::new(pixel.u - center.u, pixel.v - center.v) / half;
    let r2 = p.norm_squared();
    [
        Vector2::new(1.0, 0.0),
        Vector2::new(0.0, 1.0),
        Vector2::new(p.x, 0.0),
        Vector2::new(0.0, p.y),
        p * r2,
        p * (r2 * r2),
        p * (r2 * r2 * r2),
        Vector2::new(2.0 * p.x * p.y, r2 + 2.0 * p.y * p.y),
        Vector2::new(r2 + 2.0 * p.x * p.x, 2.0 * p.x * p.y),
    ]
}
