//! The procedure from start to end.

use super::alternation::{Alternated, AlternationSettings, CameraControl, alternate, rms_mm};
use super::plane_map::{NetworkSettings, PlaneMap};
use super::rays::{RaySource, control, lattice};
use super::spread::{SpreadChoice, choose};
use super::stage_circle::{StageCircles, project_onto_circles};
use super::start::{Start, StartKind, starts};
use super::stereo::Mean;
use crate::adjust::Observations;
use crate::adjust::observations::ViewBlock;
use crate::init::rig::RigStart;
use calib_rays::geometry::{RigidTransform, nearest_point};
use calib_rays::numerics::median;
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How to estimate. The default is what was measured best, [`AlternatingSettings::published`] the
/// procedure as it is printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlternatingSettings {
    /// Spread of the networks, px; `None` chooses by corners left out.
    pub spread_px: Option<f64>,
    /// Most neurons of a network. The publication does not say how many.
    pub neurons: usize,
    /// Seed of the neurons' places.
    pub seed: u64,
    /// Whether networks learn only what a homography leaves.
    pub warp: bool,
    /// Distance of the pixels that take part in the alternation, as a share of the sensor's width.
    pub lattice_share: f64,
    /// When to stop.
    pub alternation: AlternationSettings,
    /// Where to start; `None` takes the start with the lowest cost.
    pub start: Option<StartKind>,
    /// How poses of several cameras are averaged.
    pub mean: Mean,
    /// Whether poses of a stage placement are projected onto circles, if that lowers the cost.
    pub circles: bool,
}

impl Default for AlternatingSettings {
    fn default() -> Self {
        Self {
            spread_px: None,
            neurons: 60,
            seed: 1,
            warp: true,
            lattice_share: 48.0 / 1280.0,
            alternation: AlternationSettings {
                sweeps: 300,
                step_mm: 1e-5,
                mixing: 20,
            },
            start: None,
            mean: Mean::L2,
            circles: true,
        }
    }
}

impl AlternatingSettings {
    /// As printed: networks of the whole map with the spread of 6000 px, poses of each camera's own
    /// pinhole averaged, sweeps without mixing. How many sweeps the publication made it does not
    /// say; a hundred take its step below any limit one would set by it.
    pub fn published() -> Self {
        Self {
            spread_px: Some(6000.0),
            warp: false,
            start: Some(StartKind::AveragedPinholes),
            alternation: AlternationSettings {
                sweeps: 100,
                step_mm: 1e-5,
                mixing: 0,
            },
            ..Self::default()
        }
    }
}

/// A start with what it costs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StartCost {
    /// Which.
    pub kind: StartKind,
    /// RMS distance of control points from their rays, mm (14).
    pub rms_mm: f64,
}

/// The circles of one stage placement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlacementCircles {
    /// Number of the placement.
    pub placement: usize,
    /// Numbers of the poses, in the order of the circles' angles.
    pub poses: Vec<usize>,
    /// What was found.
    pub circles: StageCircles,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct AlternatingEstimate {
    /// What went in.
    pub observations: Observations,
    /// Per pose index, frame of the datum board; `None` where no camera placed the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Index of the datum pose.
    pub datum: usize,
    /// What turns pixels into rays, per camera.
    pub cameras: Vec<RaySource>,
    /// Per camera: its orientation as the start has it, its origin where its rays nearly meet.
    pub rig_from_camera: Vec<RigidTransform>,
    /// The spread.
    pub spread: SpreadChoice,
    /// The starts tried; the cheapest was taken.
    pub starts: Vec<StartCost>,
    /// Circles of the start's poses per placement, and whether the poses were projected onto them.
    pub circles: Vec<PlacementCircles>,
    /// See [`Self::circles`].
    pub projected: bool,
    /// How the alternation went.
    pub alternated: Alternated,
}

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlternatingError {
    /// No view has enough corners.
    #[error(
        "no view has the {} corners that a network needs to be trained and tested; the published \
         procedure maps each view by itself and cannot use smaller ones",
        super::spread::MIN_TESTED_CORNERS
    )]
    FewCorners,
    /// The start asked for does not exist.
    #[error("there is no start of the kind asked for: no pinhole explains the corners")]
    NoStart,
    /// No pixel sees enough boards.
    #[error(
        "no pixel looks at {} boards that lie {} % of their distance apart; the published procedure \
         fits every pixel's ray by itself",
        super::alternation::MIN_BOARDS, 100.0 * super::alternation::MIN_DEPTH_SHARE
    )]
    FewBoards,
}

/// Estimates from screened observations and the project's own start for them. `placement` says which
/// stage placement a pose (by number) belongs to; without it the steps of the stage are left out.
///
/// Cost: a second or two for two cameras and 34 poses.
///
/// # Errors
/// [`AlternatingError`].
pub fn estimate(
    own: &RigStart,
    placement: &dyn Fn(usize) -> Option<usize>,
    settings: &AlternatingSettings,
) -> Result<AlternatingEstimate, AlternatingError> {
    let observations = &own.observations;
    // (2)
    let mut network = NetworkSettings {
        spread_px: 0.0,
        neurons: settings.neurons,
        seed: settings.seed,
        warp: settings.warp,
    };
    let spread = if let Some(spread_px) = settings.spread_px {
        SpreadChoice {
            spread_px,
            tried: Vec::new(),
        }
    } else {
        let views: Vec<&ViewBlock> = observations.views.iter().collect();
        choose(&views, &network).ok_or(AlternatingError::FewCorners)?
    };
    network.spread_px = spread.spread_px;
    let maps = train(observations, &network);

    // (3) to (5), (31), (32)
    let mut tried = Vec::new();
    let wanted = |start: &Start| settings.start.is_none_or(|kind| start.kind == kind);
    let mut all = starts(observations, own, settings.mean);
    all.retain(wanted);
    if all.is_empty() {
        return Err(AlternatingError::NoStart);
    }
    for start in all {
        let controls = controls(observations, &maps, &start.rig_from_camera, settings);
        if let Some(rms_mm) = rms_mm(&controls, &start.rig_from_board) {
            tried.push((
                StartCost {
                    kind: start.kind,
                    rms_mm,
                },
                start,
                controls,
            ));
        }
    }
    let costs: Vec<StartCost> = tried.iter().map(|(cost, ..)| *cost).collect();
    let (cost, start, controls) = tried
        .into_iter()
        .min_by(|a, b| a.0.rms_mm.total_cmp(&b.0.rms_mm))
        .ok_or(AlternatingError::FewBoards)?;
    let datum = start.datum().ok_or(AlternatingError::FewBoards)?;

    // (6) to (12)
    let (circles, on_circles) = stage_circles(observations, &start, placement, datum);
    let projected = settings.circles
        && !circles.is_empty()
        && rms_mm(&controls, &on_circles).is_some_and(|rms| rms < cost.rms_mm);
    let poses = if projected {
        on_circles
    } else {
        start.rig_from_board.clone()
    };

    // (13) to (30)
    let alternated = alternate(&controls, &poses, datum, &settings.alternation);
    let cameras: Vec<RaySource> = maps
        .into_iter()
        .zip(&start.rig_from_camera)
        .map(|(maps, camera)| RaySource {
            maps,
            rig_from_board: alternated.poses.clone(),
            place_mm: camera.translation_mm,
        })
        .collect();
    let rig_from_camera = cameras
        .iter()
        .zip(&start.rig_from_camera)
        .zip(&observations.sensors)
        .map(|((source, camera), sensor)| {
            let spacing = spacing_px(sensor.width, settings);
            meeting_place(source, *camera, &source.lattice(*sensor, spacing))
        })
        .collect();
    Ok(AlternatingEstimate {
        observations: observations.clone(),
        rig_from_board: alternated.poses.clone(),
        datum,
        cameras,
        rig_from_camera,
        spread,
        starts: costs,
        circles,
        projected,
        alternated,
    })
}

/// A network per view: per camera and pose index.
fn train(observations: &Observations, settings: &NetworkSettings) -> Vec<Vec<Option<PlaneMap>>> {
    let trained: Vec<Option<PlaneMap>> = observations
        .views
        .par_iter()
        .map(|view| PlaneMap::train(&view.corners, settings))
        .collect();
    let mut maps = vec![vec![None; observations.poses.len()]; observations.sensors.len()];
    for (view, map) in observations.views.iter().zip(trained) {
        maps[view.camera_idx][view.pose_idx] = map;
    }
    maps
}

fn spacing_px(width: u32, settings: &AlternatingSettings) -> f64 {
    (settings.lattice_share * f64::from(width)).max(1.0)
}

/// Control points of a lattice of pixels per camera.
fn controls(
    observations: &Observations,
    maps: &[Vec<Option<PlaneMap>>],
    rig_from_camera: &[RigidTransform],
    settings: &AlternatingSettings,
) -> Vec<CameraControl> {
    observations
        .sensors
        .iter()
        .zip(maps)
        .zip(rig_from_camera)
        .map(|((sensor, maps), camera)| CameraControl {
            pixels: lattice(*sensor, spacing_px(sensor.width, settings))
                .into_par_iter()
                .map(|pixel| control(maps, pixel))
                .collect(),
            place_mm: camera.translation_mm,
        })
        .collect()
}

/// Circles per placement, and all poses projected onto them, in the frame of the datum board again.
fn stage_circles(
    observations: &Observations,
    start: &Start,
    placement: &dyn Fn(usize) -> Option<usize>,
    datum: usize,
) -> (Vec<PlacementCircles>, Vec<Option<RigidTransform>>) {
    let board = &observations.board;
    let corners: Vec<Vector3<f64>> = (0..board.corner_count())
        .map(|k| board.corner_in_board(k / board.cols, k % board.cols))
        .collect();
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (pose_idx, pose) in observations.poses.iter().enumerate() {
        if let Some(placement) = placement(*pose) {
            groups.entry(placement).or_default().push(pose_idx);
        }
    }
    let mut found = Vec::new();
    let mut poses = start.rig_from_board.clone();
    for (placement, group) in groups {
        let (indices, placed): (Vec<usize>, Vec<RigidTransform>) = group
            .into_iter()
            .filter_map(|pose_idx| Some((pose_idx, start.rig_from_board[pose_idx]?)))
            .unzip();
        if let Some((circles, moved)) = project_onto_circles(&placed, &corners) {
            for (pose_idx, moved) in indices.iter().zip(moved) {
                poses[*pose_idx] = Some(moved);
            }
            found.push(PlacementCircles {
                placement,
                poses: indices.iter().map(|idx| observations.poses[*idx]).collect(),
                circles,
            });
        }
    }
    // The frame stays that of the start: what moved as a whole would only move the cameras.
    if let (Some(moved), Some(kept)) = (poses[datum], start.rig_from_board[datum]) {
        let back = kept * moved.inverse();
        for pose in poses.iter_mut().flatten() {
            *pose = back * *pose;
        }
    }
    (found, poses)
}

/// A camera moved to where its rays come nearest to each other, if that is about where it was: a
/// field's offsets are then small.
fn meeting_place(
    source: &RaySource,
    camera: RigidTransform,
    lattice: &[Option<super::rays::SupportedRay>],
) -> RigidTransform {
    let rays: Vec<_> = lattice.iter().flatten().map(|ray| ray.ray).collect();
    let Some(distance) = median(lattice.iter().flatten().map(|ray| ray.near_mm)) else {
        return camera;
    };
    match nearest_point(&rays) {
        Some(place) if (place - source.place_mm).norm() < 0.25 * distance => {
            RigidTransform::new(camera.rotation, place)
        }
        _ => camera,
    }
}
