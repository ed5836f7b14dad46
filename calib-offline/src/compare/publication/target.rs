//! The measurement target: its point cloud, and the error against the distance (publication, Fig. 10
//! and 11). Its markers are known to each other, so no truth of the rig is needed.

use super::ExperimentError;
use super::runs::{InDatum, MethodRun, measure_all};
use super::statistics::ErrorStatistics;
use calib_judge::measured_board::MeasuredBoard;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::best_placement;
use calib_rays::measure::Sighting;
use calib_rays::numerics::rms;
use calib_rays::progress::Progress;
use calib_recording::dataset::{Dataset, TargetSpec};
use calib_recording::detect::ring_target::{
    MarkerMatch, TargetError, TargetSettings, join_markers, target_views,
};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A pose with fewer markers says little.
const MIN_MARKERS: usize = 6;

/// A pose of the target as a method measured it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TargetPose {
    /// Its number.
    pub pose: usize,
    /// From the middle of the cameras to the middle of the target, mm.
    pub distance_mm: f64,
    /// Distances of the markers from the best-placed nominal target.
    pub errors: ErrorStatistics,
    /// RMS error of the distances of neighboring markers, mm; `None` where no two are neighbors.
    pub neighbor_rms_mm: Option<f64>,
    /// RMS distance of the markers from their true places, after one rigid placement of all poses
    /// together; `None` without truth.
    pub true_rms_mm: Option<f64>,
}

/// What a method measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetMethod {
    /// Its name.
    pub method: &'static str,
    /// Markers that it has no point for.
    pub without_point: usize,
    /// Distances from the best-placed nominal target, all poses together.
    pub errors: Option<ErrorStatistics>,
    /// RMS error of the distances of neighboring markers, all poses together, mm.
    pub neighbor_rms_mm: Option<f64>,
    /// RMS distance from the true places after one rigid placement, all poses together, mm.
    pub true_rms_mm: Option<f64>,
    /// The largest standard deviation of a pose, mm.
    pub largest_pose_deviation_mm: Option<f64>,
    /// Per pose, in their order.
    pub poses: Vec<TargetPose>,
}

/// A marker of the point cloud, frame of the datum board, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CloudPoint {
    /// Pose of the target.
    pub pose: usize,
    /// Row on the target.
    pub row: usize,
    /// Column on the target.
    pub col: usize,
    /// As measured.
    pub measured_mm: Vector3<f64>,
    /// Where the best-placed nominal target has it.
    pub nominal_mm: Vector3<f64>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetExperiment {
    /// Markers that all cameras saw.
    pub markers: usize,
    /// Of these, markers that every method measured: errors are of those.
    pub common: usize,
    /// Per method.
    pub methods: Vec<TargetMethod>,
    /// Which method the point cloud is of.
    pub cloud_method: Option<&'static str>,
    /// The point cloud.
    #[serde(skip)]
    pub cloud: Vec<CloudPoint>,
}

/// Measures the target of a dataset with all methods.
///
/// The outer error ends the command; the inner one, in words, leaves the experiment out.
///
/// # Errors
/// Unreadable images or tables.
pub fn run(
    dataset: &Dataset,
    runs: &[MethodRun],
    progress: &dyn Progress,
) -> Result<Result<TargetExperiment, String>, ExperimentError> {
    let views = match target_views(dataset, &TargetSettings::default(), progress) {
        Ok(views) => views,
        Err(
            error
            @ (TargetError::NoTarget | TargetError::NoImages | TargetError::AllRefused { .. }),
        ) => return Ok(Err(error.to_string())),
        Err(error) => return Err(error.into()),
    };
    let Some(target) = &dataset.target else {
        return Ok(Err(TargetError::NoTarget.to_string()));
    };
    let matches = join_markers(target, &views, dataset.cameras.len());
    if matches.len() < MIN_MARKERS {
        return Ok(Err("no marker was seen by all cameras".to_owned()));
    }
    let truth = read_truth(&dataset.folder.join("target/truth.csv"))?;
    Ok(Ok(experiment(target, &matches, &truth, runs)))
}

fn experiment(
    target: &TargetSpec,
    matches: &[MarkerMatch],
    truth: &Truth,
    runs: &[MethodRun],
) -> TargetExperiment {
    let sightings: Vec<Vec<Sighting<f64>>> = matches
        .iter()
        .map(|m| {
            let pixels = m.pixels.iter().enumerate();
            pixels.map(|(k, pixel)| (k, [pixel.u, pixel.v])).collect()
        })
        .collect();
    let measured = measure_all(runs, &sightings);
    // A target is a board of markers.
    let board = BoardSpec::chessboard(target.rows, target.cols, target.pitch_mm);
    let mut methods = Vec::new();
    let (mut cloud_method, mut cloud) = (None, Vec::new());
    for (method, solution, points) in &measured.methods {
        let mut by_pose: BTreeMap<usize, MeasuredBoard> = BTreeMap::new();
        for ((found, point), common) in matches.iter().zip(points).zip(&measured.is_common) {
            if let (Some(point), true) = (point, common) {
                let pose = by_pose.entry(found.pose).or_default();
                pose.corners.push((found.row, found.col, *point));
            }
        }
        by_pose.retain(|_, measured| measured.corners.len() >= MIN_MARKERS);
        let placed: Vec<CloudPoint> = by_pose
            .iter()
            .flat_map(|(pose, measured)| cloud_of(*pose, measured, &board))
            .collect();
        let mut found = judge(method, &by_pose, &placed, solution, &board);
        found.without_point = points.iter().filter(|point| point.is_none()).count();
        compare_with_truth(&mut found, &placed, |p| {
            truth.get(&target.marker_id(p.pose, p.row, p.col)).copied()
        });
        methods.push(found);
        // Joint comes last: it is shown if it is there.
        if !placed.is_empty() {
            (cloud_method, cloud) = (Some(*method), placed);
        }
    }
    TargetExperiment {
        markers: matches.len(),
        common: measured.is_common.iter().filter(|common| **common).count(),
        methods,
        cloud_method,
        cloud,
    }
}

/// The markers of a pose beside the best-placed nominal target.
fn cloud_of(pose: usize, measured: &MeasuredBoard, board: &BoardSpec) -> Vec<CloudPoint> {
    let (nominal, found): (Vec<_>, Vec<_>) = measured
        .corners
        .iter()
        .map(|(row, col, point)| (board.corner_in_board(*row, *col), *point))
        .unzip();
    let Some(datum_from_target) = best_placement(&nominal, &found) else {
        return Vec::new();
    };
    measured
        .corners
        .iter()
        .zip(&nominal)
        .map(|((row, col, point), nominal)| CloudPoint {
            pose,
            row: *row,
            col: *col,
            measured_mm: *point,
            nominal_mm: datum_from_target.point(nominal),
        })
        .collect()
}

fn judge(
    method: &'static str,
    by_pose: &BTreeMap<usize, MeasuredBoard>,
    placed: &[CloudPoint],
    found: &InDatum,
    board: &BoardSpec,
) -> TargetMethod {
    let middle_of_cameras = middle(&found.cameras_in_datum);
    let (mut poses, mut all, mut neighbors) = (Vec::new(), Vec::new(), Vec::new());
    for (pose, measured) in by_pose {
        let here: Vec<&CloudPoint> = placed.iter().filter(|p| p.pose == *pose).collect();
        let errors: Vec<f64> = here
            .iter()
            .map(|p| (p.measured_mm - p.nominal_mm).norm())
            .collect();
        let nominal: Vec<Vector3<f64>> = here.iter().map(|p| p.nominal_mm).collect();
        let neighbor: Vec<f64> = measured
            .neighbor_errors(board)
            .into_iter()
            .map(|share| share * board.square_mm)
            .collect();
        if let Some(statistics) = ErrorStatistics::of(&errors) {
            poses.push(TargetPose {
                pose: *pose,
                distance_mm: (middle(&nominal) - middle_of_cameras).norm(),
                errors: statistics,
                neighbor_rms_mm: rms(&neighbor),
                true_rms_mm: None,
            });
        }
        all.extend(errors);
        neighbors.extend(neighbor);
    }
    TargetMethod {
        method,
        without_point: 0,
        errors: ErrorStatistics::of(&all),
        neighbor_rms_mm: rms(&neighbors),
        true_rms_mm: None,
        largest_pose_deviation_mm: poses.iter().map(|p| p.errors.deviation_mm).reduce(f64::max),
        poses,
    }
}

/// True places of markers by their id, mm.
type Truth = BTreeMap<usize, Vector3<f64>>;

/// A row of `target/truth.csv`; its other columns are for other uses.
#[derive(Debug, Deserialize)]
struct TrueMarker {
    id: usize,
    x: f64,
    y: f64,
    z: f64,
}

/// Empty if there is no such file.
fn read_truth(file: &Path) -> Result<Truth, ExperimentError> {
    if !file.exists() {
        return Ok(Truth::new());
    }
    let wrong = |error: csv::Error| ExperimentError::Truth {
        file: file.to_owned(),
        problem: error.to_string(),
    };
    let mut reader = csv::Reader::from_path(file).map_err(wrong)?;
    reader
        .deserialize()
        .map(|row| row.map(|m: TrueMarker| (m.id, Vector3::new(m.x, m.y, m.z))))
        .collect::<Result<_, _>>()
        .map_err(wrong)
}

/// Fills in the errors against the truth, where there is any.
fn compare_with_truth(
    found: &mut TargetMethod,
    placed: &[CloudPoint],
    truth: impl Fn(&CloudPoint) -> Option<Vector3<f64>>,
) {
    let known: Vec<(usize, Vector3<f64>, Vector3<f64>)> = placed
        .iter()
        .filter_map(|p| Some((p.pose, p.measured_mm, truth(p)?)))
        .collect();
    let (from, to): (Vec<_>, Vec<_>) = known.iter().map(|(_, from, to)| (*from, *to)).unzip();
    let Some(truth_from_datum) = best_placement(&from, &to) else {
        return;
    };
    let errors: Vec<(usize, f64)> = known
        .iter()
        .map(|(pose, from, to)| (*pose, (truth_from_datum.point(from) - to).norm()))
        .collect();
    let of = |keep: &dyn Fn(usize) -> bool| {
        let kept = errors.iter().filter(|(pose, _)| keep(*pose));
        let kept: Vec<f64> = kept.map(|(_, error)| *error).collect();
        rms(&kept)
    };
    found.true_rms_mm = of(&|_| true);
    for pose in &mut found.poses {
        pose.true_rms_mm = of(&|number| number == pose.pose);
    }
}

/// Mean of places; the origin of none.
pub fn middle(places: &[Vector3<f64>]) -> Vector3<f64> {
    places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64
}
