//! A simulated dataset as files: what a user would have recorded, and beside it the truth.
//!
//! | file | what it is |
//! | --- | --- |
//! | `dataset.toml` | the manifest |
//! | `corners.csv` | observed corners (left out if images are written, unless both are asked for) |
//! | `NAME/0000.png` | images, one per pose |
//! | `matches.csv`, `matches_truth.csv` | pixels to measure inside the swept volume, and the truth |
//! | `holdout.csv`, `holdout_truth.csv` | the same for board corners at poses never recorded |
//! | `target/` | images of the ring target, `target/matches.csv` and `target/truth.csv` |
//! | `truth.json` | settings, optics, extrinsics, poses and a lattice of true rays per camera |
//!
//! Columns of the truth tables: `x,y,z` the true point in the datum frame (the board at pose 0),
//! `x_left,y_left,z_left` the same point in the left camera's frame, `x_oracle,y_oracle,z_oracle`
//! where the true rays of the noisy pixels meet (datum frame): what a perfect calibration would
//! measure; `board,row,col` which corner it was, for held-out boards. Millimeters; numbers are
//! written so that reading them gives the same bits.

use super::error::SimulateError;
use super::images::{write_board_images, write_target};
use super::matches::{MatchSet, TrueMatch};
use super::scene::Scene;
use super::settings::OutputSettings;
use super::tables::{corner_table, manifest, match_table, truth, truth_table};
use super::writer::Writer;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What was written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulateSummary {
    /// The folder.
    pub folder: PathBuf,
    /// Kind of optics.
    pub optics: super::OpticsKind,
    /// Seed of everything random.
    pub seed: u64,
    /// Cameras.
    pub camera_count: usize,
    /// Poses.
    pub pose_count: usize,
    /// Corners in `corners.csv`.
    pub corner_count: usize,
    /// Images of the board.
    pub image_count: usize,
    /// Rows of `matches.csv`.
    pub point_count: usize,
    /// Rows of `holdout.csv`.
    pub holdout_count: usize,
    /// RMS error of a perfect calibration on `matches.csv`, mm.
    pub points_oracle_rms_mm: f64,
    /// The same on `holdout.csv`, mm.
    pub holdout_oracle_rms_mm: f64,
    /// Share of each camera's image (where it forms one) inside the hull of all corners.
    pub hull_share: Vec<f64>,
    /// Bytes of all files together.
    pub byte_count: u64,
}

/// Simulates into `folder`, which appears whole or not at all.
///
/// The files are written into a temporary folder beside it, which is then renamed.
///
/// # Errors
/// [`SimulateError::OutputIsFile`], [`SimulateError::OutputNotEmpty`] (unless `force`),
/// [`SimulateError::TooFewMatches`], [`SimulateError::Io`], [`SimulateError::Image`].
pub fn write_dataset(
    scene: &Scene,
    settings: &OutputSettings,
    folder: &Path,
    force: bool,
) -> Result<SimulateSummary, SimulateError> {
    check_output(folder, force)?;
    let at = |path: &Path| {
        let path = path.to_path_buf();
        move |source| SimulateError::Io { path, source }
    };
    let parent = match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(parent).map_err(at(parent))?;
    let scratch = tempfile::Builder::new()
        .prefix(".simulate-")
        .tempdir_in(parent)
        .map_err(at(parent))?;
    // A folder inside the temporary one: it has the usual permissions.
    let fresh = scratch.path().join("new");
    std::fs::create_dir(&fresh).map_err(at(&fresh))?;
    let mut writer = Writer {
        folder: fresh.clone(),
        byte_count: 0,
    };
    let mut summary = write_files(scene, settings, &mut writer)?;
    summary.folder = folder.to_path_buf();
    summary.byte_count = writer.byte_count;
    if folder.exists() {
        let old = scratch.path().join("old");
        std::fs::rename(folder, &old).map_err(at(folder))?;
        if let Err(source) = std::fs::rename(&fresh, folder) {
            // Put the old one back; if that fails too, the first error is the one to tell.
            let _ = std::fs::rename(&old, folder);
            return Err(at(folder)(source));
        }
    } else {
        std::fs::rename(&fresh, folder).map_err(at(folder))?;
    }
    Ok(summary)
}

/// Refuses an output that is a file or would be overwritten.
fn check_output(folder: &Path, force: bool) -> Result<(), SimulateError> {
    if !folder.exists() {
        return Ok(());
    }
    let path = folder.to_path_buf();
    if !folder.is_dir() {
        return Err(SimulateError::OutputIsFile { path });
    }
    let mut entries = std::fs::read_dir(folder).map_err(|source| SimulateError::Io {
        path: path.clone(),
        source,
    })?;
    if entries.next().is_some() && !force {
        return Err(SimulateError::OutputNotEmpty { path });
    }
    Ok(())
}

fn write_files(
    scene: &Scene,
    settings: &OutputSettings,
    writer: &mut Writer,
) -> Result<SimulateSummary, SimulateError> {
    writer.text(
        "dataset.toml",
        &manifest(scene, settings.images, settings.ring_target),
    )?;
    let mut corner_count = 0;
    if settings.corners {
        let views = scene.observe_corners();
        corner_count = views.iter().map(|view| view.corners.len()).sum();
        writer.text("corners.csv", &corner_table(&scene.names, &views))?;
    }
    let mut oracle_rms = [0.0; 2];
    let mut counts = [0; 2];
    for (k, (name, set, need)) in [
        ("matches", MatchSet::Points, settings.point_count),
        ("holdout", MatchSet::Holdout, settings.holdout_count),
    ]
    .into_iter()
    .enumerate()
    {
        let matches = scene.matches(set, need);
        if matches.len() < need {
            return Err(SimulateError::TooFewMatches {
                need,
                have: matches.len(),
            });
        }
        writer.text(
            &format!("{name}.csv"),
            &match_table(
                &scene.names,
                matches.iter().map(|entry| (entry.id, &entry.pixels[..])),
            ),
        )?;
        writer.text(&format!("{name}_truth.csv"), &truth_table(&matches))?;
        counts[k] = matches.len();
        oracle_rms[k] = oracle_rms_mm(&matches);
    }
    let mut image_count = 0;
    if settings.images {
        image_count = write_board_images(scene, settings, writer)?;
    }
    if settings.ring_target {
        write_target(scene, settings, writer)?;
    }
    let truth =
        serde_json::to_string(&truth(scene, settings)).map_err(|error| SimulateError::Io {
            path: writer.folder.join("truth.json"),
            source: error.into(),
        })?;
    writer.text("truth.json", &(truth + "\n"))?;
    Ok(SimulateSummary {
        folder: PathBuf::new(),
        optics: scene.settings.optics,
        seed: scene.settings.seed,
        camera_count: scene.cameras.len(),
        pose_count: scene.true_poses.len(),
        corner_count,
        image_count,
        point_count: counts[0],
        holdout_count: counts[1],
        points_oracle_rms_mm: oracle_rms[0],
        holdout_oracle_rms_mm: oracle_rms[1],
        hull_share: (0..scene.cameras.len())
            .map(|camera_idx| scene.hull_share(camera_idx))
            .collect(),
        byte_count: 0,
    })
}

/// RMS distance of the oracle's points from the true ones, mm.
pub fn oracle_rms_mm(matches: &[TrueMatch]) -> f64 {
    let sum: f64 = matches
        .iter()
        .map(|entry| (entry.oracle_in_datum - entry.point_in_datum).norm_squared())
        .sum();
    (sum / matches.len().max(1) as f64).sqrt()
}
