//! Matches of a simulated dataset, measured by the device's code and compared with their truth.

use crate::evaluate::truth::{PointWithTruth, TruthErrors, compare_with_truth};
use calib_blob::matches::{BlobSource, MatchesError, read_known};
use calib_rays::measure::{PointSource, Sighting};
use nalgebra::Vector3;
use ray_runtime::RayBlob;
use serde::Serialize;
use std::path::Path;

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

/// Measures every file of matches of a dataset that has its truth beside it. Also returns the
/// matches, for devices.
///
/// # Errors
/// Unreadable files.
pub fn measure_known(
    folder: &Path,
    blob: &RayBlob<'_>,
) -> Result<(Vec<KnownPoints>, Vec<Pair>), MatchesError> {
    let (mut results, mut pairs) = (Vec::new(), Vec::new());
    // Without a frame there is always a source.
    let Some(source) = BlobSource::new(blob, None) else {
        return Ok((results, pairs));
    };
    for known in read_known::<f32>(folder, &source.cameras())? {
        let points: Vec<PointWithTruth> = known
            .matches
            .iter()
            .zip(&known.truth)
            .filter_map(|(sightings, truth)| {
                let found = source.point(sightings).ok()?;
                Some(PointWithTruth::new(
                    Vector3::from(found.point_mm.map(f64::from)),
                    truth,
                ))
            })
            .collect();
        results.push(KnownPoints {
            matches: known.matches.len(),
            without_point: known.matches.len() - points.len(),
            errors: compare_with_truth(&points),
            file: known.file,
        });
        pairs.extend(
            known
                .matches
                .iter()
                .filter_map(|s| Pair::try_from(&s[..]).ok()),
        );
    }
    Ok((results, pairs))
}
