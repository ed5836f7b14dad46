//! Posterior covariance of what a model predicts: where cameras see points, given what they were
//! fitted to (METHOD 5).

use super::components::Components;
use super::normal_equations::{NormalEquations, parameters_to_columns};
use super::schur_complement::{Eliminated, SchurComplement};
use crate::adjust::model::{Layout, Model};
use crate::adjust::residual::linearize;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use calib_rays::numerics::cholesky::gram;
use nalgebra::{DMatrix, DVector, Matrix2x3, Vector3, Vector6};

/// A point fixed in the board frame of one pose, or in the rig's frame where poses are known, seen at a pixel of one camera. Its predictions
/// are the two components of observed minus predicted pixel.
#[derive(Debug, Clone, Copy)]
pub struct Sighting {
    /// Index of the camera.
    pub camera_idx: usize,
    /// Where it is seen.
    pub pixel: PixelPoint,
    /// In that frame (not necessarily on the board), mm.
    pub point_in_board: Vector3<f64>,
}

/// Derivatives of the two predictions of a sighting by all parameters.
struct Forms {
    global: [DVector<f64>; 2],
    pose: [Vector6<f64>; 2],
    /// Knots of the camera's spline, in knot order: place and derivative of both components.
    knots: Vec<(usize, [[f64; 2]; 2])>,
    by_point: Matrix2x3<f64>,
}

/// Joint covariance of the predictions of sightings, px^2: rows and columns `2 k + component`.
///
/// All points are fixed in the frame of pose `pose_idx`, or in the rig's if there is none. `by_point` (px/mm, board frame, 2 rows per
/// sighting) says what moving the points does. `None` if a point lies behind its camera.
pub fn sighting_covariance(
    model: &Model,
    layout: &Layout,
    equations: &NormalEquations,
    reduced: &SchurComplement,
    pose_idx: Option<usize>,
    sightings: &[Sighting],
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let maps: Vec<DMatrix<f64>> = model.cameras.iter().map(parameters_to_columns).collect();
    let forms: Vec<Forms> = sightings
        .iter()
        .map(|sighting| forms(model, layout, &maps, pose_idx, sighting))
        .collect::<Option<_>>()?;
    let count = 2 * forms.len();
    let mut by_point = DMatrix::zeros(count, 3);
    for (k, form) in forms.iter().enumerate() {
        by_point
            .view_mut((2 * k, 0), (2, 3))
            .copy_from(&form.by_point);
    }
    let mut covariance = DMatrix::zeros(count, count);
    let border_len = reduced.global_len + reduced.pose_columns();
    let mut border = DMatrix::zeros(border_len, count);
    for (k, form) in forms.iter().enumerate() {
        for component in 0..2 {
            border
                .view_mut((0, 2 * k + component), (reduced.global_len, 1))
                .copy_from(&form.global[component]);
        }
    }
    match &reduced.eliminated {
        Eliminated::Poses(factors) => {
            if let Some(pose_idx) = pose_idx {
                let factor = factors.get(pose_idx)?;
                let mut own = DMatrix::zeros(6, count);
                for (k, form) in forms.iter().enumerate() {
                    for component in 0..2 {
                        own.set_column(2 * k + component, &form.pose[component]);
                    }
                }
                border -= &equations.arrow.poses[pose_idx].cross * factor.solve(&own);
                factor.l_dirty().solve_lower_triangular_mut(&mut own);
                covariance += own.transpose() * &own;
            }
        }
        Eliminated::Splines(splines) => {
            for (k, form) in forms.iter().enumerate() {
                let Some(pose_idx) = pose_idx else { break };
                for component in 0..2 {
                    border
                        .view_mut(
                            (reduced.global_len + 6 * pose_idx, 2 * k + component),
                            (6, 1),
                        )
                        .copy_from(&form.pose[component]);
                }
            }
            for (camera_idx, spline) in splines.iter().enumerate() {
                let Some(spline) = spline else {
                    continue;
                };
                let own: Vec<usize> = (0..forms.len())
                    .filter(|k| sightings[*k].camera_idx == camera_idx)
                    .collect();
                if own.is_empty() {
                    continue;
                }
                let columns = 2 * own.len();
                let mut knots = vec![0.0; spline.row_count() * columns];
                for (at, k) in own.iter().enumerate() {
                    for (place, values) in &forms[*k].knots {
                        for (a, by_component) in values.iter().enumerate() {
                            for (component, value) in by_component.iter().enumerate() {
                                knots[(2 * place + a) * columns + 2 * at + component] += value;
                            }
                        }
                    }
                }
                spline.solve_lower(&mut knots, columns);
                let share = full(gram(&knots, &vec![0; columns]));
                let pulled = spline.pull(&knots, columns, border_len);
                for (a, k) in own.iter().enumerate() {
                    for component in 0..2 {
                        let column = 2 * k + component;
                        let mut target = border.column_mut(column);
                        target -= pulled.column(2 * a + component);
                        for (b, l) in own.iter().enumerate() {
                            for other in 0..2 {
                                covariance[(column, 2 * l + other)] +=
                                    share[(2 * a + component, 2 * b + other)];
                            }
                        }
                    }
                }
            }
        }
    }
    // Column-major storage is the transpose in row-major storage.
    let mut border = border.transpose();
    let begins = vec![0; count];
    reduced.border.solve_lower(border.as_mut_slice(), &begins);
    covariance += full(gram(border.as_slice(), &begins));
    Some((covariance, by_point))
}

/// A symmetric matrix from its lower triangle.
fn full(mut lower: DMatrix<f64>) -> DMatrix<f64> {
    lower.fill_upper_triangle_with_lower_triangle();
    lower
}

fn forms(
    model: &Model,
    layout: &Layout,
    maps: &[DMatrix<f64>],
    pose_idx: Option<usize>,
    sighting: &Sighting,
) -> Option<Forms> {
    let camera = &model.cameras[sighting.camera_idx];
    let pose = match pose_idx {
        Some(pose_idx) => *model.rig_from_board.get(pose_idx)?,
        None => RigidTransform::identity(),
    };
    let turned_in_board = pose.rotation * sighting.point_in_board;
    let turned_in_rig = camera.camera_from_rig.rotation * (turned_in_board + pose.translation_mm);
    let point_in_camera = turned_in_rig + camera.camera_from_rig.translation_mm;
    let l = linearize(&camera.field.sample(sighting.pixel), &point_in_camera)?;
    let by_rig = l.by_point * camera.camera_from_rig.rotation;
    let components = Components::of(camera);
    let degree = camera
        .field
        .offset
        .as_ref()
        .map_or(0, |offset| offset.polynomial.degree)
        .max(camera.field.direction.polynomial.degree);
    let mut products = Vec::new();
    calib_rays::field::polynomial::basis(
        camera.field.sensor,
        degree,
        sighting.pixel,
        &mut products,
    );
    let ranges = &layout.cameras[sighting.camera_idx];
    let by_pose = RigidTransform::by_step(&by_rig, &turned_in_board);
    let by_camera = RigidTransform::by_step(&l.by_point, &turned_in_rig);
    let component_forms = |r: usize| {
        let mut columns = DVector::zeros(components.len());
        for a in 0..components.count() {
            let j = if a < 2 {
                l.by_s[(r, a)]
            } else {
                l.by_m[(r, a - 2)]
            };
            for k in 0..components.terms(a) {
                columns[components.start(a) + k] = j * products[k][0];
            }
        }
        let mut global = DVector::zeros(layout.global_len);
        let own = maps[sighting.camera_idx].tr_mul(&columns);
        global
            .rows_mut(ranges.direction.start, own.len())
            .copy_from(&own);
        if let Some(range) = &ranges.extrinsics {
            for k in 0..6 {
                global[range.start + k] = by_camera[(r, k)];
            }
        }
        global
    };
    let mut knots = Vec::new();
    if let (Some(order), Some(spline)) = (camera.knot_order(), &camera.field.direction.spline) {
        let u = spline.grid.weights_u(sighting.pixel.u);
        let v = spline.grid.weights_v(sighting.pixel.v);
        for j in 0..4 {
            for i in 0..4 {
                let weight = u.value[i] * v.value[j];
                let by = |a: usize| [weight * l.by_s[(0, a)], weight * l.by_s[(1, a)]];
                knots.push((order.place(u.first + i, v.first + j), [by(0), by(1)]));
            }
        }
    }
    Some(Forms {
        global: [component_forms(0), component_forms(1)],
        pose: [0, 1].map(|r| by_pose.row(r).transpose()),
        knots,
        by_point: by_rig * pose.rotation,
    })
}
