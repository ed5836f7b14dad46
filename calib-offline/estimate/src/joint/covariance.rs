//! How well each ray is known after the estimate, and where the noise of a pixel takes it.

use super::error::EstimateError;
use super::estimate::Estimate;
use crate::adjust::equations::covariance::{Sighting, sighting_covariance};
use calib_rays::field::uncertainty::{PairUncertainty, node_pixel, packed};
use calib_rays::field::{CalibratedCamera, Rig};
use calib_rays::geometry::so3::skew;
use calib_rays::geometry::{PixelPoint, Ray, midpoint_by_shifts};
use calib_rays::numerics::SingularValues;
use nalgebra::{DMatrix, Matrix3x2, Vector3};

/// Nodes of a grid along the longer side of the sensor.
const NODES_ALONG_LONGER_SIDE: usize = 11;
/// Of the coarser grids at the least and largest distance of boards, which say with it what moves
/// rigidly.
const VOLUME_NODES_ALONG_LONGER_SIDE: usize = 8;
/// Singular values below this share of the largest count as zero: a rigid motion that moves no point.
pub(super) const RIGID_RANK_SHARE: f64 = 1e-9;

impl Estimate {
    /// Fills in how well the pairs of a rig (made by [`Estimate::rig`]) know their rays (METHOD 5).
    ///
    /// Both cameras of a pair are asked where they see a point at the working distance that is
    /// fixed in the datum frame. What a rigid motion of the whole rig explains is taken out, as it
    /// changes no measured shape: so this is not the uncertainty of the datum itself. The motion is
    /// that of points through the whole depth in which boards stood; of those at one distance alone
    /// it would explain much of what changes the shape.
    ///
    /// The noise of pixels is taken to be that of the corners that were not rejected.
    ///
    /// Cameras that never see the same point at the working distance get no entry.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn fill_uncertainty(&mut self, rig: &mut Rig) -> Result<(), EstimateError> {
        let (layout, equations, reduced) = self.fit.equations(&self.observations)?;
        let distances = self.board_distances_mm(rig);
        let Some(distance_mm) = distances.get(distances.len() / 2).copied() else {
            return Ok(());
        };
        let mut all = Vec::new();
        for second in 1..rig.cameras.len() {
            let pair = [&rig.cameras[0], &rig.cameras[second]];
            let (nodes_u, nodes_v) = node_counts(pair[0], NODES_ALONG_LONGER_SIDE);
            let Some(mut nodes) = nodes([0, second], pair, distance_mm) else {
                continue;
            };
            for distance_mm in distances.first().into_iter().chain(distances.last()) {
                nodes.extend(volume_nodes([0, second], pair, *distance_mm));
            }
            let sightings: Vec<Sighting> =
                nodes.iter().flatten().map(|node| node.sighting).collect();
            let covariance = sighting_covariance(
                &self.model,
                &layout,
                &equations,
                &reduced,
                self.model.frame_pose(),
                &sightings,
            );
            let Some((covariance, by_point)) = covariance else {
                continue;
            };
            let Some(covariance) = without_rigid_motions(&covariance, &by_point, &nodes) else {
                continue;
            };
            let calibration_px2 = (0..nodes_u * nodes_v)
                .map(|k| packed(&covariance.fixed_view::<4, 4>(4 * k, 4 * k).into_owned()))
                .collect();
            all.push(PairUncertainty {
                first: 0,
                second,
                sensor: pair[0].field.sensor,
                nodes_u,
                nodes_v,
                calibration_px2,
                noise_px2: self.fit.pixel_variance_px2(&self.observations),
            });
        }
        rig.uncertainty = all;
        Ok(())
    }
}

/// A camera's part in a node.
#[derive(Clone, Copy)]
pub(super) struct Node {
    pub(super) sighting: Sighting,
    /// Rig frame.
    ray: Ray,
    /// Shift of the ray at the point, rig frame.
    pub(super) mm_per_px: Matrix3x2<f64>,
    /// Whether it is the nearest measured place, in place of a node that is not measured.
    stands_in: bool,
}

fn node_counts(camera: &CalibratedCamera, along_longer_side: usize) -> (usize, usize) {
    let sensor = camera.field.sensor;
    let longer = f64::from(sensor.width.max(sensor.height));
    let count = |extent: u32| {
        ((along_longer_side as f64 * f64::from(extent) / longer).round() as usize).max(2)
    };
    (count(sensor.width), count(sensor.height))
}

/// The nodes of a pair, row-major over the first camera. A node whose point the pair does not
/// measure takes the value of the nearest place where it does, so that interpolation inside is not
/// spoilt by extrapolation outside. `None` if there is no such place.
fn nodes(
    indices: [usize; 2],
    pair: [&CalibratedCamera; 2],
    distance_mm: f64,
) -> Option<Vec<[Node; 2]>> {
    let (nodes_u, nodes_v) = node_counts(pair[0], NODES_ALONG_LONGER_SIDE);
    let see_both = |pixel: PixelPoint| see_both(indices, pair, pixel, distance_mm);
    let measured: Vec<(PixelPoint, [Node; 2])> = pair[0]
        .coverage
        .covered_middles()
        .into_iter()
        .filter_map(|pixel| Some((pixel, see_both(pixel)?)))
        .collect();
    let sensor = pair[0].field.sensor;
    (0..nodes_u * nodes_v)
        .map(|k| {
            let pixel = node_pixel(sensor, nodes_u, nodes_v, k % nodes_u, k / nodes_u);
            see_both(pixel).or_else(|| {
                measured
                    .iter()
                    .min_by(|a, b| a.0.distance_px(pixel).total_cmp(&b.0.distance_px(pixel)))
                    .map(|(_, nodes)| {
                        nodes.map(|node| Node {
                            stands_in: true,
                            ..node
                        })
                    })
            })
        })
        .collect()
}

/// Coarser nodes at another distance, where both cameras measure.
fn volume_nodes(
    indices: [usize; 2],
    pair: [&CalibratedCamera; 2],
    distance_mm: f64,
) -> Vec<[Node; 2]> {
    let (nodes_u, nodes_v) = node_counts(pair[0], VOLUME_NODES_ALONG_LONGER_SIDE);
    (0..nodes_u * nodes_v)
        .filter_map(|k| {
            let (i, j) = (k % nodes_u, k / nodes_u);
            let pixel = node_pixel(pair[0].field.sensor, nodes_u, nodes_v, i, j);
            see_both(indices, pair, pixel, distance_mm)
        })
        .collect()
}

/// A node where both cameras see the point at a distance along the first one's ray.
fn see_both(
    indices: [usize; 2],
    pair: [&CalibratedCamera; 2],
    pixel: PixelPoint,
    distance_mm: f64,
) -> Option<[Node; 2]> {
    let (point_in_rig, other) = pair[0].seen_by(pair[1], pixel, distance_mm)?;
    Some([
        node(indices[0], pair[0], pixel, point_in_rig),
        node(indices[1], pair[1], other, point_in_rig),
    ])
}

/// A camera's part in a point that it sees at a pixel.
pub(super) fn node(
    camera_idx: usize,
    camera: &CalibratedCamera,
    pixel: PixelPoint,
    point_in_rig: Vector3<f64>,
) -> Node {
    Node {
        sighting: Sighting {
            camera_idx,
            pixel,
            point_in_board: point_in_rig,
        },
        ray: camera.field.ray(pixel).transformed(&camera.rig_from_camera),
        mm_per_px: camera.ray_shift_mm_per_px(pixel, &point_in_rig),
        stands_in: false,
    }
}

/// What predictions (px) do to the points of nodes, mm; `None` where rays are parallel.
pub(super) fn points_by_predictions(nodes: &[[Node; 2]]) -> Option<DMatrix<f64>> {
    let mut to_points = DMatrix::zeros(3 * nodes.len(), 4 * nodes.len());
    for (k, [a, b]) in nodes.iter().enumerate() {
        let (by_a, by_b) = midpoint_by_shifts(&a.ray, &b.ray)?;
        to_points
            .view_mut((3 * k, 4 * k), (3, 2))
            .copy_from(&(by_a * a.mm_per_px));
        to_points
            .view_mut((3 * k, 4 * k + 2), (3, 2))
            .copy_from(&(by_b * b.mm_per_px));
    }
    Some(to_points)
}

/// What remains of the covariance when the best rigid motion of all measured points is taken out.
///
/// Points move by `T r` with the predictions r, a rigid motion `a` changes predictions by `R a`;
/// the motion that fits best in mm is `a = (T R)^+ T r`, so `r - R a` remains.
fn without_rigid_motions(
    covariance: &DMatrix<f64>,
    by_point: &DMatrix<f64>,
    nodes: &[[Node; 2]],
) -> Option<DMatrix<f64>> {
    let count = covariance.nrows();
    let mut motions = DMatrix::zeros(count, 6);
    for (k, node) in nodes.iter().flatten().enumerate() {
        let by = by_point.fixed_view::<2, 3>(2 * k, 0);
        motions
            .view_mut((2 * k, 0), (2, 3))
            .copy_from(&(-by * skew(&node.sighting.point_in_board)));
        motions.view_mut((2 * k, 3), (2, 3)).copy_from(&by);
    }
    let mut to_points = points_by_predictions(nodes)?;
    // Only points that are measured say where the rig moved to.
    for (k, [a, _]) in nodes.iter().enumerate() {
        if a.stands_in {
            to_points.rows_mut(3 * k, 3).fill(0.0);
        }
    }
    let moved = &to_points * &motions;
    let best_motion = SingularValues::new(moved)?.pseudo_inverse(RIGID_RANK_SHARE) * to_points;
    let projector = DMatrix::identity(count, count) - motions * best_motion;
    Some(&projector * covariance * projector.transpose())
}
