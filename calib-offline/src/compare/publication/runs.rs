//! All methods on the same corners, brought to one frame, and what they measure there.

use crate::methods::{Given, METHODS, MethodError, Solution};
use calib_judge::known_points::Points;
use calib_rays::geometry::RigidTransform;
use calib_rays::measure::Sighting;
use calib_rays::progress::Silent;
use nalgebra::Vector3;
use serde::Serialize;

/// A solution in the frame of the board at a pose that all methods placed.
#[derive(Debug)]
pub struct InDatum {
    solution: Solution,
    datum_from_rig: RigidTransform,
    /// Number of each pose placed, and where the board was.
    pub datum_from_board: Vec<(usize, RigidTransform)>,
    /// Where the cameras are, mm.
    pub cameras_in_datum: Vec<Vector3<f64>>,
}

impl InDatum {
    /// In its own frame yet.
    fn new(solution: Solution) -> Self {
        let numbers = solution.observations.poses.iter().copied();
        let mut poses: Vec<_> = numbers.zip(solution.rig_from_board.clone()).collect();
        // A pose whose views do not belong together stands here twice.
        poses.dedup_by_key(|(pose, _)| *pose);
        let cameras = solution.rig.cameras.iter();
        Self {
            datum_from_rig: RigidTransform::identity(),
            datum_from_board: poses,
            cameras_in_datum: cameras.map(|c| c.rig_from_camera.translation_mm).collect(),
            solution,
        }
    }

    /// Points of matches by the method's own rays, mm; `None` where it has no rays or they do not meet.
    pub fn measure(&self, matches: &[Vec<Sighting<f64>>]) -> Points {
        let points = self.solution.measure(matches).into_iter();
        points
            .map(|point| Some(self.datum_from_rig.point(&point?)))
            .collect()
    }

    /// Spread of the networks, px, if there are any.
    pub fn spread_px(&self) -> Option<f64> {
        let record = self.solution.alternating.as_ref()?;
        Some(record.spread.spread_px)
    }

    fn pose(&self, number: usize) -> Option<RigidTransform> {
        let found = self.datum_from_board.iter().find(|(n, _)| *n == number);
        found.map(|(_, pose)| *pose)
    }

    fn move_to(&mut self, datum_from_rig: RigidTransform) {
        self.datum_from_rig = datum_from_rig;
        for (_, pose) in &mut self.datum_from_board {
            *pose = datum_from_rig * *pose;
        }
        for place in &mut self.cameras_in_datum {
            *place = datum_from_rig.point(place);
        }
    }
}

/// What came of a method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodOutcome {
    /// Its name.
    pub method: &'static str,
    /// Poses that it placed.
    pub placed_poses: usize,
    /// Why there is nothing of it.
    pub failed: Option<String>,
}

/// A method with what came of it.
#[derive(Debug)]
pub struct MethodRun {
    /// Its name.
    pub method: &'static str,
    /// What it found, or why there is nothing.
    pub outcome: Result<InDatum, MethodError>,
    /// Number of the pose whose board is the frame.
    pub datum_pose: usize,
}

impl MethodRun {
    /// For the record.
    pub fn outcome(&self) -> MethodOutcome {
        let found = self.outcome.as_ref();
        MethodOutcome {
            method: self.method,
            placed_poses: found.map_or(0, |found| found.datum_from_board.len()),
            failed: found.err().map(MethodError::reason),
        }
    }
}

/// The solutions of a list of runs, with the methods' names.
pub fn solved(runs: &[MethodRun]) -> impl Iterator<Item = (&'static str, &InDatum)> {
    runs.iter()
        .filter_map(|run| Some((run.method, run.outcome.as_ref().ok()?)))
}

/// Runs all methods on the same corners, and brings them to one frame: that of the first pose that all
/// of them placed.
pub fn run_all(given: &Given) -> Vec<MethodRun> {
    let mut runs: Vec<MethodRun> = METHODS
        .iter()
        .map(|method| MethodRun {
            method: method.name(),
            outcome: method.fit(given, &Silent).map(InDatum::new),
            datum_pose: 0,
        })
        .collect();
    share_datum(&mut runs);
    runs
}

fn share_datum(runs: &mut [MethodRun]) {
    let common = {
        let mut all = solved(runs).map(|(_, found)| found);
        let Some(first) = all.next() else { return };
        let others: Vec<&InDatum> = all.collect();
        let mut numbers = first.datum_from_board.iter().map(|(number, _)| *number);
        numbers.find(|n| others.iter().all(|other| other.pose(*n).is_some()))
    };
    let Some(datum) = common else { return };
    for run in runs {
        run.datum_pose = datum;
        if let Ok(found) = &mut run.outcome
            && let Some(pose) = found.pose(datum)
        {
            found.move_to(pose.inverse());
        }
    }
}

/// Points per method, and which of them can be compared.
#[derive(Debug)]
pub struct Measured<'a> {
    /// The methods that have a solution.
    pub methods: Vec<(&'static str, &'a InDatum, Points)>,
    /// Whether every method that measures at all has a point for the match.
    pub is_common: Vec<bool>,
}

/// Measures matches with all methods. One that measures less than half of them does not decide what
/// the others are judged by.
pub fn measure_all<'a>(runs: &'a [MethodRun], matches: &[Vec<Sighting<f64>>]) -> Measured<'a> {
    let methods: Vec<_> = solved(runs)
        .map(|(method, found)| (method, found, found.measure(matches)))
        .collect();
    let decides = |points: &Points| 2 * points.iter().flatten().count() >= points.len();
    let is_common = (0..matches.len())
        .map(|k| {
            let mut deciding = methods.iter().filter(|(.., points)| decides(points));
            deciding.all(|(.., points)| points[k].is_some())
        })
        .collect();
    Measured { methods, is_common }
}
