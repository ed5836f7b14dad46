//! The blocked equations against dense ones of the same small problem, with everything that a
//! model can have: splines, an offset, extrinsics, a bent board.

use super::equations::normal_equations::NormalEquations;
use super::levenberg::{Settings, minimize};
use super::model::{CameraModel, Model, Step};
use super::objective::{Weights, residuals};
use super::observations::{BOARD_SHAPE_SD_MM, Observations, ObservedCorner, ViewBlock};
use super::priors::{CameraPriors, Priors};
use super::residual::linearize;
use calib_rays::board::{BoardShape, BoardSpec};
use calib_rays::field::spline::{Spline, SplineGrid};
use calib_rays::field::structured::StructuredBasis;
use calib_rays::field::{BaseLens, Projection, RayField, SmoothMap};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use nalgebra::{DMatrix, DVector, Vector2, Vector3, Vector6};

const SENSOR: SensorSize = SensorSize::new(400, 300);
const BOARD: BoardSpec = BoardSpec::chessboard(6, 7, 10.0);

/// A number that looks random, between -1 and 1.
fn wild(k: usize) -> f64 {
    (k as f64 * 12.9898 + 0.3).sin()
}

fn camera(idx: usize, has_offset: bool, has_spline: bool) -> CameraModel {
    let base = BaseLens::ideal(Projection::Perspective, 420.0);
    let mut field = RayField::ideal(SENSOR, base, 3);
    for (k, c) in field
        .direction
        .polynomial
        .coefficients
        .iter_mut()
        .enumerate()
    {
        *c += Vector2::new(wild(k + idx), wild(2 * k)) * 1e-3;
    }
    if has_spline {
        let mut spline = Spline::zero(SplineGrid::with_spacing(SENSOR, 100.0));
        for (k, c) in spline.coefficients.iter_mut().enumerate() {
            *c = Vector2::new(wild(3 * k + idx), wild(5 * k)) * 1e-4;
        }
        field.direction.spline = Some(spline);
    }
    if has_offset {
        let mut offset = SmoothMap::zero(2);
        for (k, c) in offset.polynomial.coefficients.iter_mut().enumerate() {
            *c = Vector2::new(wild(k), wild(7 * k)) * 0.05;
        }
        field.offset = Some(offset);
    }
    CameraModel {
        basis: StructuredBasis::new(SENSOR, 3, None),
        offset_basis: has_offset.then(|| StructuredBasis::offset(SENSOR, 2, &base)),
        field,
        camera_from_rig: if idx == 0 {
            RigidTransform::identity()
        } else {
            RigidTransform::new(
                so3::exp(&Vector3::new(0.0, 0.1, 0.02)),
                Vector3::new(-20.0, 1.0, 2.0),
            )
        },
    }
}

/// A model, and corners that miss it by 1e-5 px, so that the residual's Jacobian is exact.
fn example(has_spline: [bool; 2]) -> (Model, Observations) {
    let mut board_shape = BoardShape::flat_of_degree_two();
    for (k, term) in board_shape.terms.iter_mut().enumerate() {
        term.2 = wild(k) * 0.05;
    }
    let model = Model {
        cameras: vec![
            camera(0, false, has_spline[0]),
            camera(1, true, has_spline[1]),
        ],
        rig_from_board: (0..5)
            .map(|k| {
                let turn = Vector3::new(wild(k), wild(k + 9), wild(k + 5)) * 0.5;
                let rotation = so3::exp(&turn);
                let middle = Vector3::new(
                    10.0 * wild(k + 2),
                    8.0 * wild(k + 3),
                    110.0 + 15.0 * wild(k),
                );
                RigidTransform::new(rotation, middle - rotation * BOARD.center_in_board())
            })
            .collect(),
        known_poses: Vec::new(),
        board_shape,
    };
    let mut views = Vec::new();
    for (camera_idx, camera) in model.cameras.iter().enumerate() {
        for (pose_idx, pose) in model.rig_from_board.iter().enumerate() {
            // Each camera misses one pose.
            if pose_idx == 3 * camera_idx {
                continue;
            }
            let mut corners = Vec::new();
            for (row, col) in
                (0..BOARD.rows).flat_map(|row| (0..BOARD.cols).map(move |col| (row, col)))
            {
                let point_in_board = BOARD.corner_in_board(row, col);
                let mut bent = point_in_board;
                bent.z += model.board_shape.height_mm(&BOARD, &bent);
                let point = camera.camera_from_rig.point(&pose.point(&bent));
                let mut pixel = PixelPoint::new(
                    200.0 + 420.0 * point.x / point.z,
                    150.0 + 420.0 * point.y / point.z,
                );
                for _ in 0..20 {
                    let l = linearize(&camera.field.sample(pixel), &point).unwrap();
                    pixel = PixelPoint::new(pixel.u - l.residual_px.x, pixel.v - l.residual_px.y);
                }
                if pixel.u < 0.0 || pixel.v < 0.0 || pixel.u > 399.0 || pixel.v > 299.0 {
                    continue;
                }
                pixel.u += 1e-5 * wild(row + 13 * col);
                pixel.v += 1e-5 * wild(3 * row + 7 * col);
                corners.push(ObservedCorner {
                    row,
                    col,
                    point_in_board,
                    pixel,
                    beyond_px: Vector2::zeros(),
                    relative_weight: 1.0,
                });
            }
            views.push(ViewBlock {
                camera_idx,
                pose_idx,
                corners,
            });
        }
    }
    let observations = Observations {
        board: BOARD,
        board_shape_sd_mm: BOARD_SHAPE_SD_MM,
        known_poses: [].into(),
        declared_central: Vec::new(),
        sensors: vec![SENSOR; 2],
        poses: (0..model.rig_from_board.len()).collect(),
        views,
    };
    (model, observations)
}

fn priors(model: &Model) -> Priors {
    let mut cameras: Vec<_> = model.cameras.iter().map(CameraPriors::free).collect();
    for priors in &mut cameras {
        priors.direction.fill(1e4);
        priors.offset.fill(30.0);
        priors.spline = 1e9;
    }
    Priors {
        cameras,
        board: 100.0,
    }
}

/// Weights in 1/px^2; some corners do not count.
fn weights(observations: &Observations) -> Weights {
    observations
        .views
        .iter()
        .map(|view| {
            (0..view.corners.len())
                .map(|k| {
                    if k % 11 == 5 {
                        0.0
                    } else {
                        400.0 + 100.0 * wild(k)
                    }
                })
                .collect()
        })
        .collect()
}

/// All parameters in one vector: global, poses, splines.
struct Dense {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// First parameter of each camera's spline.
    splines: Vec<usize>,
}

fn flat(step: &Step) -> DVector<f64> {
    let poses = step.poses.iter().flat_map(|pose| pose.iter());
    let splines = step.splines.iter().flat_map(|spline| spline.iter());
    DVector::from_vec(
        step.global
            .iter()
            .chain(poses)
            .chain(splines)
            .copied()
            .collect(),
    )
}

fn dense(model: &Model, observations: &Observations, weights: &Weights, priors: &Priors) -> Dense {
    let layout = model.layout();
    let bases = model.view_bases(observations);
    let spline_lens: Vec<usize> = model
        .cameras
        .iter()
        .map(|c| c.spline_amounts().len())
        .collect();
    let fixed = layout.global_len + 6 * model.rig_from_board.len();
    let len = fixed + spline_lens.iter().sum::<usize>();
    let splines = vec![fixed, fixed + spline_lens[0]];
    let unit = |k: usize, h: f64| {
        let mut x = DVector::zeros(len);
        x[k] = h;
        Step {
            global: x.rows(0, layout.global_len).into_owned(),
            poses: (0..model.rig_from_board.len())
                .map(|p| {
                    Vector6::from_iterator(x.rows(layout.global_len + 6 * p, 6).iter().copied())
                })
                .collect(),
            splines: (0..2)
                .map(|c| x.rows(splines[c], spline_lens[c]).into_owned())
                .collect(),
        }
    };
    let all = |model: &Model| -> DVector<f64> {
        let residuals = residuals(model, observations, &bases);
        let scaled = residuals
            .iter()
            .zip(weights)
            .flat_map(|(residuals, weights)| {
                residuals.iter().zip(weights).flat_map(|(r, w)| {
                    let r = r.unwrap() * w.sqrt();
                    [r.x, r.y]
                })
            });
        DVector::from_vec(scaled.collect())
    };
    let here = all(model);
    let mut jacobian = DMatrix::zeros(here.len(), len);
    for k in 0..len {
        let h = 1e-5;
        let ahead = all(&model.stepped(&layout, &unit(k, h)));
        let behind = all(&model.stepped(&layout, &unit(k, -h)));
        jacobian.set_column(k, &((ahead - behind) / (2.0 * h)));
    }
    let mut hessian = jacobian.transpose() * &jacobian;
    let mut gradient = jacobian.transpose() * here;
    let mut hold = |at: usize, weight: f64, amount: f64| {
        hessian[(at, at)] += weight;
        gradient[at] += weight * amount;
    };
    for (camera, (ranges, priors)) in model
        .cameras
        .iter()
        .zip(layout.cameras.iter().zip(&priors.cameras))
    {
        let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
        for (k, at) in ranges.direction.clone().enumerate() {
            hold(at, priors.direction[k], amounts[k]);
        }
        for (k, at) in ranges.offset.clone().enumerate() {
            hold(at, priors.offset[k], camera.offset_amounts()[k]);
        }
    }
    for (at, term) in layout.board.clone().zip(&model.board_shape.terms) {
        hold(at, priors.board, term.2);
    }
    for (idx, camera) in model.cameras.iter().enumerate() {
        let Some(energy) = &priors.cameras[idx].thin_plate else {
            continue;
        };
        let weight = priors.cameras[idx].spline;
        let share = energy.times(&camera.spline_amounts()) * weight;
        let mut rows = gradient.rows_mut(splines[idx], spline_lens[idx]);
        rows += share;
        for row in 0..energy.size() {
            for column in row.saturating_sub(energy.half_bandwidth())..=row {
                let value = weight * energy.get(row, column);
                hessian[(splines[idx] + row, splines[idx] + column)] += value;
                if row != column {
                    hessian[(splines[idx] + column, splines[idx] + row)] += value;
                }
            }
        }
    }
    Dense {
        hessian,
        gradient,
        splines,
    }
}

#[test]
fn the_blocked_equations_are_the_dense_ones() {
    for has_spline in [[false, false], [true, true], [false, true]] {
        let (model, observations) = example(has_spline);
        let (weights, priors) = (weights(&observations), priors(&model));
        let layout = model.layout();
        let bases = model.view_bases(&observations);
        let equations =
            NormalEquations::assemble(&model, &layout, &observations, &bases, &weights, &priors);
        let dense = dense(&model, &observations, &weights, &priors);
        // Differences over 1e-5 leave 1e-6 of the derivatives.
        for damping in [0.0, 0.1] {
            let mut damped = dense.hessian.clone();
            for k in 0..damped.nrows() {
                damped[(k, k)] *= 1.0 + damping;
            }
            let expected = -damped.cholesky().unwrap().solve(&dense.gradient);
            let step = equations.step(&equations.reduce(damping).unwrap());
            let error = (flat(&step) - &expected).norm() / expected.norm();
            assert!(error < 1e-4, "{has_spline:?} {damping}: {error:e}");
            let promised = -dense.gradient.dot(&expected)
                + damping
                    * (0..expected.len())
                        .map(|k| dense.hessian[(k, k)] * expected[k].powi(2))
                        .sum::<f64>();
            let error = equations.predicted_decrease(&step, damping) / promised - 1.0;
            assert!(error.abs() < 1e-4, "{has_spline:?} {damping}: {error:e}");
        }
        let reduced = equations.reduce(0.0).unwrap();
        let cholesky = dense.hessian.clone().cholesky().unwrap();
        let ln_determinant: f64 = 2.0 * cholesky.l().diagonal().map(f64::ln).sum();
        assert!((reduced.ln_determinant() - ln_determinant).abs() < 1e-3);
        let covariance = cholesky.inverse();
        for (k, variance) in reduced.marginal_variances().iter().enumerate() {
            assert!((variance / covariance[(k, k)] - 1.0).abs() < 1e-3, "{k}");
        }
        // With the unit vectors for probes, the estimate of the trace is the trace by their number.
        for (idx, priors) in priors.cameras.iter().enumerate() {
            let Some(energy) = &priors.thin_plate else {
                assert_eq!(reduced.spline_trace(idx, &[], &[]), 0.0);
                continue;
            };
            let size = energy.size();
            let units: Vec<_> = (0..size)
                .map(|k| DVector::from_fn(size, |row, _| f64::from(u8::from(row == k))))
                .collect();
            let weighted: Vec<_> = units.iter().map(|unit| energy.times(unit)).collect();
            let found = reduced.spline_trace(idx, &units, &weighted) * size as f64;
            let own = covariance.view((dense.splines[idx], dense.splines[idx]), (size, size));
            let expected: f64 = weighted
                .iter()
                .enumerate()
                .map(|(k, weighted)| weighted.dot(&own.column(k)))
                .sum();
            assert!((found / expected - 1.0).abs() < 1e-3, "{has_spline:?}");
        }
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let (model, observations) = example([true, true]);
    let (weights, priors) = (weights(&observations), priors(&model));
    let bases = model.view_bases(&observations);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let settings = Settings::default();
        pool.unwrap().install(|| {
            minimize(
                model.clone(),
                &observations,
                &bases,
                &weights,
                &priors,
                settings,
            )
            .costs
        })
    };
    assert_eq!(with(1), with(3));
}
