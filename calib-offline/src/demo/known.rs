//! Matches of a simulated dataset, measured by the device's code and compared with their truth.

use super::DemoError;
use crate::error::Error;
use crate::evaluate::truth::{PointWithTruth, TruthErrors, compare_with_truth};
use crate::matches::source::BlobSource;
use crate::matches::{PointSource, Sighting, read_matches};
use nalgebra::Vector3;
use ray_runtime::RayBlob;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Files of matches that may stand in a dataset, each with `NAME_truth.csv` beside it.
const FILES: [&str; 2] = ["matches", "holdout"];

/// A match as a device measures it: two cameras' pixels.
pub type Pair = [Sighting<f32>; 2];

/// A file of matches and what the runtime made of it, single precision.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KnownPoints {
    /// The file's name.
    pub file: String,
    /// Matches in it.
    pub matches: usize,
    /// Matches without a point: outside the calibrated area, or with rays that do not meet.
    pub without_point: usize,
    /// How far the points are from the truth.
    pub errors: Option<TruthErrors>,
}

/// A row of the table of true points; its other columns are for other uses.
#[derive(Debug, Deserialize)]
struct TrueRow {
    x: f64,
    y: f64,
    z: f64,
    x_oracle: f64,
    y_oracle: f64,
    z_oracle: f64,
}

/// Measures every file of matches of a dataset that has its truth beside it. Also returns the
/// matches, for devices.
///
/// # Errors
/// Unreadable files.
pub fn measure_known(
    folder: &Path,
    blob: &RayBlob<'_>,
) -> Result<(Vec<KnownPoints>, Vec<Pair>), Error> {
    let (mut results, mut pairs) = (Vec::new(), Vec::new());
    for name in FILES {
        let file = folder.join(format!("{name}.csv"));
        let truth_file = folder.join(format!("{name}_truth.csv"));
        if !(file.exists() && truth_file.exists()) {
            continue;
        }
        // Without a frame there is always a source.
        let Some(source) = BlobSource::new(blob, None) else {
            continue;
        };
        let matches = read_matches::<f32>(&file, &source.cameras())?;
        let truth = read_truth(&truth_file)?;
        if truth.len() != matches.len() {
            return Err(Error::Demo(DemoError::TruthCount {
                file: truth_file,
                have: truth.len(),
                need: matches.len(),
            }));
        }
        let points: Vec<PointWithTruth> = matches
            .iter()
            .zip(&truth)
            .filter_map(|(sightings, row)| {
                let found = source.point(sightings).ok()?;
                Some(PointWithTruth {
                    measured_mm: Vector3::from(found.point_mm.map(f64::from)),
                    true_mm: Vector3::new(row.x, row.y, row.z),
                    oracle_mm: Vector3::new(row.x_oracle, row.y_oracle, row.z_oracle),
                })
            })
            .collect();
        results.push(KnownPoints {
            file: format!("{name}.csv"),
            matches: matches.len(),
            without_point: matches.len() - points.len(),
            errors: compare_with_truth(&points),
        });
        pairs.extend(matches.iter().filter_map(|s| Pair::try_from(&s[..]).ok()));
    }
    Ok((results, pairs))
}

fn read_truth(file: &Path) -> Result<Vec<TrueRow>, DemoError> {
    let error = |source| DemoError::Truth {
        file: file.to_owned(),
        source,
    };
    let mut reader = csv::Reader::from_path(file).map_err(error)?;
    reader
        .deserialize()
        .collect::<Result<_, _>>()
        .map_err(error)
}
