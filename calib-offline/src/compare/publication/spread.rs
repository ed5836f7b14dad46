//! Error of the networks against their spread (publication, Fig. 7), as published: without a
//! homography before them. Beyond the publication: spreads below 1000 px, and corners left out.

use super::auxiliary::{SIDE_MM, seen_markers};
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ViewBlock;
use calib_estimate::alternating::AlternatingSettings;
use calib_estimate::alternating::plane_map::{NetworkSettings, TrainingSet};
use calib_estimate::alternating::spread::sweep;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::rms;
use calib_simulate::Scene;
use rayon::prelude::*;
use serde::Serialize;

/// The publication's range, px, and what it chose.
pub const PUBLISHED_PX: [f64; 2] = [1000.0, 7000.0];
/// See [`PUBLISHED_PX`].
pub const PUBLISHED_CHOICE_PX: f64 = 6000.0;
/// Where the wide range begins, px.
pub const WIDE_FROM_PX: f64 = 100.0;

/// How much is tried. The default is the publication's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExperimentSettings {
    /// Networks from 1000 to 7000 px, spread by spread.
    pub spreads: usize,
    /// Spreads from 100 px on.
    pub wide_spreads: usize,
    /// Views that the networks' errors are taken over, at most.
    pub views: usize,
}

impl Default for ExperimentSettings {
    fn default() -> Self {
        Self {
            spreads: 700,
            wide_spreads: 60,
            views: 4,
        }
    }
}

/// Errors at one spread, all views together, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpreadPoint {
    /// The spread, px.
    pub spread_px: f64,
    /// RMS at the corners trained on.
    pub training_rms_mm: f64,
    /// RMS at inner corners left out of the training.
    pub left_out_rms_mm: f64,
    /// RMS error of the distance of two auxiliary markers of one side.
    pub marker_rms_mm: Option<f64>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpreadExperiment {
    /// Views that the errors are taken over.
    pub views: usize,
    /// Most neurons of a network.
    pub neurons: usize,
    /// Pairs of auxiliary markers that were seen.
    pub marker_pairs: usize,
    /// From 1000 to 7000 px. The curves are in the table of the figure, not in the JSON.
    #[serde(skip)]
    pub published: Vec<SpreadPoint>,
    /// From 100 to 7000 px, evenly on a logarithmic scale.
    #[serde(skip)]
    pub wide: Vec<SpreadPoint>,
    /// Of all spreads, that with the least error at corners left out, px.
    pub best_px: f64,
    /// The error there, mm.
    pub best_left_out_rms_mm: f64,
    /// What the alternating method chose, with a homography before its networks, px.
    pub alternating_px: Option<f64>,
    /// The error at the publication's choice of 6000 px (the nearest spread tried), mm.
    pub published_choice_left_out_rms_mm: f64,
}

/// Trains the networks.
///
/// # Errors
/// In words, if no view has corners enough.
pub fn run(
    observations: &Observations,
    scene: Option<&Scene>,
    alternating_px: Option<f64>,
    settings: &ExperimentSettings,
) -> Result<SpreadExperiment, String> {
    let views = drawn(observations, settings.views);
    let network = NetworkSettings {
        spread_px: 0.0,
        neurons: AlternatingSettings::default().neurons,
        seed: AlternatingSettings::default().seed,
        warp: false,
    };
    let [from, to] = PUBLISHED_PX;
    let between = |count: usize, k: usize| k as f64 / count.saturating_sub(1).max(1) as f64;
    let published: Vec<f64> = (0..settings.spreads)
        .map(|k| from + (to - from) * between(settings.spreads, k))
        .collect();
    let wide: Vec<f64> = (0..settings.wide_spreads)
        .map(|k| WIDE_FROM_PX * (to / WIDE_FROM_PX).powf(between(settings.wide_spreads, k)))
        .collect();
    let sides = scene.map_or_else(Vec::new, |scene| {
        sides(scene, observations, &views, &network)
    });
    let curve = |spreads: &[f64]| -> Vec<SpreadPoint> {
        let found = sweep(&views, spreads, &network);
        found
            .into_par_iter()
            .map(|error| SpreadPoint {
                spread_px: error.spread_px,
                training_rms_mm: error.training_rms_mm,
                left_out_rms_mm: error.left_out_rms_mm,
                marker_rms_mm: marker_rms_mm(&sides, error.spread_px),
            })
            .collect()
    };
    let (published, wide) = (curve(&published), curve(&wide));
    let all = || published.iter().chain(&wide);
    let best = all().min_by(|a, b| a.left_out_rms_mm.total_cmp(&b.left_out_rms_mm));
    let off = |p: &SpreadPoint| (p.spread_px - PUBLISHED_CHOICE_PX).abs();
    let choice = all().min_by(|a, b| off(a).total_cmp(&off(b)));
    let (Some(best), Some(choice)) = (best.copied(), choice.copied()) else {
        return Err("no view has corners enough to train and to test a network".to_owned());
    };
    Ok(SpreadExperiment {
        views: views.len(),
        neurons: network.neurons,
        marker_pairs: sides.iter().map(|view| view.pairs.len()).sum(),
        published,
        wide,
        best_px: best.spread_px,
        alternating_px,
        best_left_out_rms_mm: best.left_out_rms_mm,
        published_choice_left_out_rms_mm: choice.left_out_rms_mm,
    })
}

/// An even draw of the views with most corners.
fn drawn(observations: &Observations, count: usize) -> Vec<&ViewBlock> {
    let most = observations.views.iter().map(|v| v.corners.len()).max();
    let enough = most.unwrap_or(0) * 9 / 10;
    let full: Vec<&ViewBlock> = observations
        .views
        .iter()
        .filter(|view| view.corners.len() >= enough)
        .collect();
    let step = full.len().div_ceil(count.max(1)).max(1);
    full.into_iter().step_by(step).collect()
}

/// A view with the auxiliary markers of each side that it shows.
struct ViewSides {
    training: TrainingSet,
    pairs: Vec<[PixelPoint; 2]>,
}

fn sides(
    scene: &Scene,
    observations: &Observations,
    views: &[&ViewBlock],
    network: &NetworkSettings,
) -> Vec<ViewSides> {
    views
        .iter()
        .filter_map(|view| {
            let pose = *observations.poses.get(view.pose_idx)?;
            let seen = seen_markers(scene, view.camera_idx, pose);
            let pairs = (0..4).filter_map(|k| Some([seen[k]?, seen[(k + 1) % 4]?]));
            Some(ViewSides {
                training: TrainingSet::new(&view.corners, network)?,
                pairs: pairs.collect(),
            })
        })
        .collect()
}

fn marker_rms_mm(views: &[ViewSides], spread_px: f64) -> Option<f64> {
    let mut errors = Vec::new();
    for view in views {
        let network = view.training.train(spread_px)?;
        errors.extend(
            view.pairs
                .iter()
                .map(|[a, b]| (network.evaluate(*a) - network.evaluate(*b)).norm() - SIDE_MM),
        );
    }
    rms(&errors)
}
