//! What a session leaves behind: a manifest, corners, and exact matches to judge a calibration by.

use super::session::Session;
use crate::error::SimulateError;
use crate::matches::MatchSet;
use crate::optics::CameraOptics;
use crate::scene::Scene;
use crate::tables::{board_section, camera_section, corner_table, match_table, stage_section};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::observed::View;
use nalgebra::Vector3;
use std::path::Path;

/// Matches that judge a calibration.
pub const MATCHES: usize = 400;

/// `[stage]`: dial readings (degrees) and placements.
#[derive(Debug, Clone, PartialEq)]
pub struct Dial {
    /// One a pose, degrees.
    pub angles_deg: Vec<f64>,
    /// One a pose.
    pub placements: Vec<usize>,
}

/// A point, and where the rig sees it as it is at the end of the recording, without noise.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactMatch {
    /// One a camera.
    pub pixels: Vec<PixelPoint>,
    /// Left camera's frame, mm.
    pub point_in_left: Vector3<f64>,
}

/// A dataset in memory, and the truth about the rig.
#[derive(Debug, Clone)]
pub struct Recording {
    /// As the manifest has it.
    pub board: BoardSpec,
    /// Of the cameras.
    pub names: Vec<&'static str>,
    /// As the manifest has them.
    pub sensors: Vec<SensorSize>,
    /// If there was a stage.
    pub dial: Option<Dial>,
    /// Corners.
    pub views: Vec<View>,
    /// [`MATCHES`] points of the volume that the same rig without the fault sees.
    pub matches: Vec<ExactMatch>,
}

impl Recording {
    /// Records a session; `usual` is the same rig with its board shown as it ought to be.
    pub fn of(session: &Session, usual: &Scene, has_dial: bool) -> Self {
        let scene = &session.scene;
        Self {
            board: scene.settings.board.clone(),
            names: scene.names.clone(),
            sensors: scene.cameras.iter().map(CameraOptics::sensor).collect(),
            dial: has_dial.then(|| Dial {
                angles_deg: scene.pose_angles_deg.clone(),
                placements: scene.pose_placements.clone(),
            }),
            views: session.views(),
            matches: exact_matches(session, usual),
        }
    }

    /// Writes `dataset.toml`, `corners.csv` and `matches.csv` into a folder that exists.
    ///
    /// # Errors
    /// [`SimulateError::Io`].
    pub fn write(&self, folder: &Path) -> Result<(), SimulateError> {
        let mut manifest = board_section(&self.board);
        for (name, sensor) in self.names.iter().zip(&self.sensors) {
            manifest.push_str(&camera_section(name, *sensor));
        }
        if let Some(dial) = &self.dial {
            manifest.push_str(&stage_section(&dial.angles_deg, &dial.placements));
        }
        let matches = self.matches.iter().enumerate();
        let matches = match_table(&self.names, matches.map(|(id, m)| (id, &m.pixels[..])));
        for (name, text) in [
            ("dataset.toml", manifest),
            ("corners.csv", corner_table(&self.names, &self.views)),
            ("matches.csv", matches),
        ] {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(|source| SimulateError::Io { path, source })?;
        }
        Ok(())
    }

    /// Number of poses.
    pub fn pose_count(&self) -> usize {
        let last = self.views.iter().map(|view| view.pose).max();
        last.map_or(0, |pose| pose + 1)
    }

    /// Numbers the poses that are left from 0 on, and the dial with them.
    pub fn keep_poses(&mut self, kept: &[usize]) {
        self.views.retain_mut(|view| {
            let place = kept.iter().position(|pose| *pose == view.pose);
            view.pose = place.unwrap_or(view.pose);
            place.is_some()
        });
        if let Some(dial) = &mut self.dial {
            dial.angles_deg = kept.iter().map(|pose| dial.angles_deg[*pose]).collect();
            dial.placements = kept.iter().map(|pose| dial.placements[*pose]).collect();
        }
    }
}

fn exact_matches(session: &Session, usual: &Scene) -> Vec<ExactMatch> {
    let (cameras, left_from_camera) = session.rig_at_the_end();
    let end = Scene {
        cameras,
        left_from_camera,
        ..usual.clone()
    };
    let matches = end.matches(MatchSet::Points, MATCHES).into_iter();
    matches
        .map(|found| ExactMatch {
            pixels: found.true_pixels,
            point_in_left: found.point_in_left,
        })
        .collect()
}
