//! Points whose truth is known: absolute error against the distance. Only simulated datasets have them.

use super::ExperimentError;
use super::runs::{MethodRun, measure_all};
use super::target::middle;
use crate::pipeline::camera_names;
use calib_blob::matches::TruePoint;
use calib_blob::matches::read_known;
use calib_judge::known_points::TruthErrors;
use calib_judge::known_points::beside_truth;
use calib_judge::known_points::compare_with_truth;
use calib_rays::geometry::best_placement;
use calib_rays::measure::Sighting;
use calib_rays::numerics::rms;
use calib_recording::dataset::Dataset;
use nalgebra::Vector3;
use serde::Serialize;

/// Bins of the distance, each with as many points as the others.
const BINS: usize = 12;

/// Points of about one distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Mean distance from the middle of the cameras, mm.
    pub distance_mm: f64,
    /// Points.
    pub points: usize,
    /// RMS distance from the truth after one rigid placement of all points, mm.
    pub placed_rms_mm: f64,
}

/// What a method measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KnownMethod {
    /// Its name.
    pub method: &'static str,
    /// Matches that it has no point for.
    pub without_point: usize,
    /// All points together.
    pub errors: Option<TruthErrors>,
    /// Against the distance.
    pub bins: Vec<Bin>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KnownExperiment {
    /// Matches with truth.
    pub matches: usize,
    /// Of these, those that every method measured: errors are of those.
    pub common: usize,
    /// Whether the frame of the points is that of the truth: else only placed errors mean something.
    pub frame_is_true: bool,
    /// Per method.
    pub methods: Vec<KnownMethod>,
    /// The true rays of the same noisy pixels, against the distance: the limit that the noise sets.
    pub oracle: Vec<Bin>,
}

/// Measures the matches of a dataset that have their truth beside them.
///
/// The outer error ends the command; the inner one, in words, leaves the experiment out.
///
/// # Errors
/// Unreadable tables.
pub fn run(
    dataset: &Dataset,
    runs: &[MethodRun],
) -> Result<Result<KnownExperiment, String>, ExperimentError> {
    let (mut matches, mut truth) = (Vec::new(), Vec::new());
    for known in read_known(&dataset.folder, &camera_names(dataset))? {
        matches.extend(known.matches);
        truth.extend(known.truth);
    }
    if matches.is_empty() {
        return Ok(Err(
            "the dataset has no matches.csv or holdout.csv with their truth".to_owned(),
        ));
    }
    Ok(Ok(experiment(runs, &matches, &truth)))
}

fn experiment(
    runs: &[MethodRun],
    matches: &[Vec<Sighting<f64>>],
    truth: &[TruePoint],
) -> KnownExperiment {
    let measured = measure_all(runs, matches);
    let common: Vec<usize> = (0..matches.len())
        .filter(|k| measured.is_common[*k])
        .collect();
    let mut middles = Vec::new();
    let mut methods = Vec::new();
    for (method, found, points) in &measured.methods {
        // A method that does not decide which points are common may lack some of them.
        let paired = beside_truth(points, truth, |k| measured.is_common[k]);
        let from: Vec<Vector3<f64>> = paired.iter().map(|p| p.measured_mm).collect();
        let to: Vec<Vector3<f64>> = paired.iter().map(|p| p.true_mm).collect();
        let mut bins_of_method = Vec::new();
        if let Some(placement) = best_placement(&from, &to) {
            let cameras = placement.point(&middle(&found.cameras_in_datum));
            middles.push(cameras);
            let errors: Vec<(f64, f64)> = paired
                .iter()
                .map(|p| {
                    let error = placement.point(&p.measured_mm) - p.true_mm;
                    ((p.true_mm - cameras).norm(), error.norm())
                })
                .collect();
            bins_of_method = bins(errors);
        }
        methods.push(KnownMethod {
            method,
            without_point: points.iter().filter(|point| point.is_none()).count(),
            errors: compare_with_truth(&paired),
            bins: bins_of_method,
        });
    }
    let cameras = middle(&middles);
    let limit = common.iter().map(|k| {
        let (at, oracle) = (truth[*k].true_mm(), truth[*k].oracle_mm());
        ((at - cameras).norm(), (oracle - at).norm())
    });
    KnownExperiment {
        matches: matches.len(),
        common: common.len(),
        // The simulation's frame is the board at pose 0.
        frame_is_true: runs.iter().all(|run| run.datum_pose == 0),
        methods,
        oracle: bins(limit.collect()),
    }
}

/// RMS of the errors of bins of the distance, from (distance, error).
fn bins(mut pairs: Vec<(f64, f64)>) -> Vec<Bin> {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = pairs.len().div_ceil(BINS).max(1);
    pairs
        .chunks(size)
        .filter_map(|chunk| {
            let errors: Vec<f64> = chunk.iter().map(|(_, error)| *error).collect();
            Some(Bin {
                distance_mm: chunk.iter().map(|(d, _)| d).sum::<f64>() / chunk.len() as f64,
                points: chunk.len(),
                placed_rms_mm: rms(&errors)?,
            })
        })
        .collect()
}
