//! The three methods on the same corners, each as something that measures points.

use super::MethodOutcome;
use crate::compare::contender::Shared;
use calib_estimate::adjust::Observations;
use calib_estimate::alternating::{self, AlternatingEstimate, AlternatingSettings};
use calib_estimate::init::rig::start_rig;
use calib_estimate::pinhole::{PinholeRig, RigSettings, calibrate_rig};
use calib_rays::field::Rig;
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, triangulate_pair, triangulate_rays};
use nalgebra::Vector3;
use serde::Serialize;

/// One pixel per camera that sees the point, with the camera's index.
pub type Pixels = [(usize, PixelPoint)];

/// A way from corners to rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A pinhole with Brown-Conrady distortion per camera.
    Baseline,
    /// The published procedure.
    Alternating,
    /// All together.
    Joint,
}

impl Method {
    /// In the order of tables and figures.
    pub const ALL: [Self; 3] = [Self::Baseline, Self::Alternating, Self::Joint];

    /// Its name in tables and figures.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Alternating => "alternating",
            Self::Joint => "joint",
        }
    }
}

/// Something that turns pixels into a point.
pub trait Measurer: Sync + Send {
    /// Where the rays of the pixels meet, in a frame of its own, mm; `None` where it has no rays or
    /// they do not meet.
    fn point(&self, pixels: &Pixels) -> Option<Vector3<f64>>;
}

impl Measurer for PinholeRig {
    fn point(&self, pixels: &Pixels) -> Option<Vector3<f64>> {
        Some(self.triangulate(pixels).ok()?.point_mm)
    }
}

impl Measurer for AlternatingEstimate {
    fn point(&self, pixels: &Pixels) -> Option<Vector3<f64>> {
        let rays: Vec<Ray> = pixels
            .iter()
            .map(|(camera_idx, pixel)| Some(self.cameras.get(*camera_idx)?.ray(*pixel)?.ray))
            .collect::<Option<_>>()?;
        let found = match &rays[..] {
            [a, b] => triangulate_pair(a, b),
            all => triangulate_rays(all),
        };
        Some(found.ok()?.point_mm)
    }
}

impl Measurer for Rig {
    fn point(&self, pixels: &Pixels) -> Option<Vector3<f64>> {
        Some(self.triangulate(pixels).ok()?.point_mm)
    }
}

/// A calibration by one of the methods. Its frame is the board at a pose that all methods placed.
pub struct Calibrated {
    measurer: Box<dyn Measurer>,
    datum_from_own: RigidTransform,
    /// Number of each pose placed, and where the board was.
    pub datum_from_board: Vec<(usize, RigidTransform)>,
    /// Where the cameras are, mm.
    pub cameras_in_datum: Vec<Vector3<f64>>,
    /// Spread of the networks, px, if there are any.
    pub spread_px: Option<f64>,
}

impl Calibrated {
    fn new(
        measurer: Box<dyn Measurer>,
        own_from_board: impl Iterator<Item = (usize, Option<RigidTransform>)>,
        cameras: Vec<Vector3<f64>>,
    ) -> Self {
        let mut poses: Vec<(usize, RigidTransform)> = own_from_board
            .filter_map(|(pose, placed)| Some((pose, placed?)))
            .collect();
        // A pose whose views do not belong together stands here twice.
        poses.dedup_by_key(|(pose, _)| *pose);
        Self {
            measurer,
            datum_from_own: RigidTransform::identity(),
            datum_from_board: poses,
            cameras_in_datum: cameras,
            spread_px: None,
        }
    }

    /// A point, datum frame, mm; see [`Measurer::point`].
    pub fn point(&self, pixels: &Pixels) -> Option<Vector3<f64>> {
        Some(self.datum_from_own.point(&self.measurer.point(pixels)?))
    }

    fn pose(&self, number: usize) -> Option<RigidTransform> {
        let found = self.datum_from_board.iter().find(|(n, _)| *n == number);
        found.map(|(_, pose)| *pose)
    }

    fn move_to(&mut self, datum_from_own: RigidTransform) {
        self.datum_from_own = datum_from_own;
        for (_, pose) in &mut self.datum_from_board {
            *pose = datum_from_own * *pose;
        }
        for place in &mut self.cameras_in_datum {
            *place = datum_from_own.point(place);
        }
    }
}

/// A method with what came of it.
pub struct MethodRun {
    /// Which.
    pub method: Method,
    /// The calibration, or why there is none.
    pub outcome: Result<Calibrated, String>,
    /// Number of the pose whose board is the frame.
    pub datum_pose: usize,
}

impl MethodRun {
    /// For the record.
    pub fn outcome(&self) -> MethodOutcome {
        let calibrated = self.outcome.as_ref();
        MethodOutcome {
            method: self.method,
            placed_poses: calibrated.map_or(0, |c| c.datum_from_board.len()),
            failed: calibrated.err().cloned(),
        }
    }
}

/// The calibrations of a list of runs.
pub fn calibrated(runs: &[MethodRun]) -> impl Iterator<Item = (Method, &Calibrated)> {
    runs.iter()
        .filter_map(|run| Some((run.method, run.outcome.as_ref().ok()?)))
}

/// Runs all methods on the same screened corners, and brings them to one frame.
pub fn run_all(shared: &Shared, names: &[String]) -> Vec<MethodRun> {
    let mut runs = vec![
        run(Method::Baseline, baseline(&shared.observations)),
        run(Method::Alternating, alternating(shared)),
        run(Method::Joint, joint(shared, names)),
    ];
    share_datum(&mut runs);
    runs
}

fn run(method: Method, outcome: Result<Calibrated, String>) -> MethodRun {
    MethodRun {
        method,
        outcome,
        datum_pose: 0,
    }
}

/// With least squares, as it is used everywhere; `compare` gives it the joint estimate's robust weights.
fn baseline(observations: &Observations) -> Result<Calibrated, String> {
    let rig =
        calibrate_rig(observations, &RigSettings::default()).map_err(|error| error.to_string())?;
    let poses = rig.first_from_board.clone();
    let places = rig.camera_from_first.iter();
    let places = places.map(|c| c.inverse().translation_mm).collect();
    let numbers = observations.poses.iter().copied();
    Ok(Calibrated::new(Box::new(rig), numbers.zip(poses), places))
}

fn alternating(shared: &Shared) -> Result<Calibrated, String> {
    let start = start_rig(&shared.observations).map_err(|error| error.to_string())?;
    let placement = |pose| shared.placement(pose);
    let estimate = alternating::estimate(&start, &placement, &AlternatingSettings::default())
        .map_err(|error| error.to_string())?;
    let poses = estimate.rig_from_board.clone();
    let places = estimate.rig_from_camera.iter();
    let places = places.map(|camera| camera.translation_mm).collect();
    let spread_px = Some(estimate.spread.spread_px);
    let numbers = estimate.observations.poses.clone().into_iter();
    let calibrated = Calibrated::new(Box::new(estimate), numbers.zip(poses), places);
    Ok(Calibrated {
        spread_px,
        ..calibrated
    })
}

fn joint(shared: &Shared, names: &[String]) -> Result<Calibrated, String> {
    let estimate = shared.joint().map_err(|error| error.to_string())?;
    let rig = estimate.rig(names);
    let places = rig.cameras.iter().map(|c| c.rig_from_camera.translation_mm);
    let places = places.collect();
    let poses = estimate.rig_from_board().into_iter().map(Some);
    let numbers = estimate.observations.poses.iter().copied();
    Ok(Calibrated::new(Box::new(rig), numbers.zip(poses), places))
}

/// Brings all calibrations to the frame of the first pose that all of them placed.
fn share_datum(runs: &mut [MethodRun]) {
    let common = {
        let mut all = runs.iter().filter_map(|run| run.outcome.as_ref().ok());
        let Some(first) = all.next() else { return };
        let others: Vec<&Calibrated> = all.collect();
        let numbers = first.datum_from_board.iter().map(|(number, _)| *number);
        numbers
            .into_iter()
            .find(|n| others.iter().all(|other| other.pose(*n).is_some()))
    };
    let Some(datum) = common else { return };
    for run in runs {
        run.datum_pose = datum;
        if let Ok(calibrated) = &mut run.outcome
            && let Some(pose) = calibrated.pose(datum)
        {
            calibrated.move_to(pose.inverse());
        }
    }
}
