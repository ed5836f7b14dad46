//! Matches of a simulated dataset with their truth beside them.

use super::{MatchesError, read_matches};
use calib_rays::measure::{Number, Sighting};
use nalgebra::Vector3;
use serde::Deserialize;
use std::path::Path;

/// Files of matches that may stand in a dataset, each with `NAME_truth.csv` beside it.
const FILES: [&str; 2] = ["matches", "holdout"];

/// Where a point is, and what the true rays of its pixels give: a row of a table of true points, whose
/// other columns are for other uses. Datum frame, mm.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct TruePoint {
    x: f64,
    y: f64,
    z: f64,
    x_oracle: f64,
    y_oracle: f64,
    z_oracle: f64,
}

impl TruePoint {
    /// Where it is.
    pub fn true_mm(&self) -> Vector3<f64> {
        Vector3::new(self.x, self.y, self.z)
    }

    /// What the true rays of the same pixels give: the limit that the noise of the pixels sets.
    pub fn oracle_mm(&self) -> Vector3<f64> {
        Vector3::new(self.x_oracle, self.y_oracle, self.z_oracle)
    }
}

/// A file of matches whose truth is known.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownMatches<N: Number> {
    /// The file's name.
    pub file: String,
    /// In the file's order.
    pub matches: Vec<Vec<Sighting<N>>>,
    /// One for each.
    pub truth: Vec<TruePoint>,
}

/// Every file of matches of a dataset's folder that has its truth beside it; none of a real recording.
///
/// # Errors
/// Files that cannot be read, or do not go together.
pub fn read_known<N: Number>(
    folder: &Path,
    cameras: &[String],
) -> Result<Vec<KnownMatches<N>>, MatchesError> {
    let mut all = Vec::new();
    for name in FILES {
        let file = folder.join(format!("{name}.csv"));
        let truth_file = folder.join(format!("{name}_truth.csv"));
        if !(file.exists() && truth_file.exists()) {
            continue;
        }
        let matches = read_matches(&file, cameras)?;
        let truth = read_truth(&truth_file)?;
        if truth.len() != matches.len() {
            return Err(MatchesError::TruthCount {
                file: truth_file,
                have: truth.len(),
                need: matches.len(),
            });
        }
        all.push(KnownMatches {
            file: format!("{name}.csv"),
            matches,
            truth,
        });
    }
    Ok(all)
}

fn read_truth(file: &Path) -> Result<Vec<TruePoint>, MatchesError> {
    let error = |source| MatchesError::Truth {
        file: file.to_owned(),
        source,
    };
    let mut reader = csv::Reader::from_path(file).map_err(error)?;
    reader
        .deserialize()
        .collect::<Result<_, _>>()
        .map_err(error)
}
