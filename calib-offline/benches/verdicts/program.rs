//! The program as a user has it: a process that is given a folder and says what it thinks of it.

use crate::Result;
use calib_rays::geometry::best_placement;
use calib_simulate::faults::{ExactMatch, Recording};
use nalgebra::Vector3;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Exit codes of a command that has done its work; with 1 the verdict is "fail".
const DONE: [i32; 2] = [0, 1];

/// A build of the program.
pub struct Program {
    pub name: &'static str,
    path: PathBuf,
}

impl Program {
    /// The one of this build.
    pub fn built() -> Self {
        Self {
            name: "this build",
            path: env!("CARGO_BIN_EXE_calib-offline").into(),
        }
    }

    /// One that stands somewhere else.
    pub fn other(path: &Path) -> Self {
        Self {
            name: "the other",
            path: path.to_owned(),
        }
    }
}

/// What a program says of a recording, and how it then measures.
pub struct Outcome {
    /// "pass", "doubtful", "fail", or "refused".
    pub verdict: String,
    /// The first cause and since which pose; `None` if no cause is named.
    pub cause: Option<(String, Option<u64>)>,
    /// What is said first where the verdict is not "pass".
    pub reason: String,
    /// `None` if there is no calibration, or none that measures.
    pub error: Option<ErrorMm>,
}

/// Of the exact matches, after the rigid placement that suits best, mm.
#[derive(Clone, Copy)]
pub struct ErrorMm {
    pub rms: f64,
    pub most: f64,
    /// Matches that were not measured, as a share.
    pub unanswered: f64,
}

impl Outcome {
    /// Whether a user is told nothing.
    pub fn is_silent(&self) -> bool {
        self.verdict == "pass"
    }
}

/// Lets a program calibrate a recording and measure with the result.
pub fn outcome(program: &Program, recording: &Recording) -> Result<Outcome> {
    let folder = tempfile::tempdir()?;
    recording.write(folder.path())?;
    let results = folder.path().join("results");
    let calibrate = Command::new(&program.path)
        .arg("calibrate")
        .arg(folder.path())
        .arg("-o")
        .arg(&results)
        .args(["--json", "--quiet", "--threads", "1"])
        .output()?;
    let said: Value = serde_json::from_slice(&calibrate.stdout).unwrap_or(Value::Null);
    let is_done = calibrate
        .status
        .code()
        .is_some_and(|code| DONE.contains(&code));
    let verdict = said["verdict"].as_str().filter(|_| is_done);
    let cause = said["causes"][0]["cause"].as_str().map(|code| {
        let since = said["causes"][0]["since_pose"].as_u64();
        (code.to_owned(), since)
    });
    let error = if is_done {
        measured(program, folder.path(), recording)?
    } else {
        None
    };
    Ok(Outcome {
        verdict: verdict.unwrap_or("refused").to_owned(),
        cause,
        reason: first_reason(&said).replace(&format!("{}/", folder.path().display()), ""),
        error,
    })
}

/// The first reason that is not "pass", or the innermost error.
fn first_reason(said: &Value) -> String {
    let texts = |key: &str| -> Vec<String> {
        let list = said[key].as_array().into_iter().flatten();
        list.filter_map(Value::as_str).map(str::to_owned).collect()
    };
    let reasons = texts("reasons");
    let reason = reasons
        .into_iter()
        .find(|reason| !reason.starts_with("pass"));
    reason.or_else(|| texts("error").pop()).unwrap_or_default()
}

fn measured(program: &Program, folder: &Path, recording: &Recording) -> Result<Option<ErrorMm>> {
    let points = folder.join("points.csv");
    let measure = Command::new(&program.path)
        .arg("measure")
        .arg(folder.join("results/calibration.json"))
        .arg(folder.join("matches.csv"))
        .arg("-o")
        .arg(&points)
        .args(["--quiet", "--threads", "1"])
        .output()?;
    if !measure.status.success() {
        return Ok(None);
    }
    let mut reader = csv::Reader::from_path(&points)?;
    let mut found = Vec::new();
    for row in reader.records() {
        let row = row?;
        let number = |column: usize| row.get(column).and_then(|text| text.parse::<f64>().ok());
        let point = [1, 2, 3].map(number);
        found.push(match point {
            [Some(x), Some(y), Some(z)] => Some(Vector3::new(x, y, z)),
            _ => None,
        });
    }
    Ok(error_mm(&found, &recording.matches))
}

/// Errors of the points that were measured, one a match; `None` if they are too few to be placed.
pub fn error_mm(points: &[Option<Vector3<f64>>], matches: &[ExactMatch]) -> Option<ErrorMm> {
    let answered = points.iter().zip(matches);
    let (found, truth): (Vec<_>, Vec<_>) = answered
        .filter_map(|(point, exact)| Some(((*point)?, exact.point_in_left)))
        .unzip();
    let placement = best_placement(&found, &truth)?;
    let errors = found.iter().zip(&truth);
    let errors = errors.map(|(point, truth)| (placement.point(point) - truth).norm());
    let (squares, most) = errors.fold((0.0, 0.0_f64), |(squares, most), error| {
        (squares + error * error, most.max(error))
    });
    Some(ErrorMm {
        rms: (squares / found.len() as f64).sqrt(),
        most,
        unanswered: 1.0 - found.len() as f64 / matches.len() as f64,
    })
}
