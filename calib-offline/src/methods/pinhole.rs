//! The baseline as a method: a pinhole with Brown-Conrady distortion per camera.

use super::solution::{came_to_rest, placed_part, weighted};
use super::{Given, Method, MethodError, Own, Solution};
use calib_estimate::adjust::Observations;
use calib_estimate::pinhole::{Loss, PinholeRig, RigSettings, Settings, calibrate_rig};
use calib_estimate::reprojection::residuals;
use calib_judge::held_out::Estimated;
use calib_rays::board::BoardShape;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use calib_rays::measure::{Point, PointSource, Sighting, Status};
use calib_rays::progress::Progress;

/// Pinholes, all cameras and poses together. Residuals count as the joint estimate's do, so that outliers
/// decide for nobody.
#[derive(Debug, Clone, Copy)]
pub struct Pinhole;

impl Method for Pinhole {
    fn name(&self) -> &'static str {
        "baseline"
    }

    fn title(&self) -> &'static str {
        "pinhole, Brown-Conrady"
    }

    fn fit(&self, given: &Given, progress: &dyn Progress) -> Result<Solution, MethodError> {
        MethodError::check_board(self.title(), &given.observations.board)?;
        progress.begin("estimate", 1);
        let offered = given.observations;
        let pinhole = calibrate_rig(offered, &settings())?;
        let found = pinhole.rig(given.names, offered)?;
        progress.end();
        let (used, rig_from_board) = placed_part(offered, &found.rig_from_board);
        let is_used = offered.views.iter().zip(pinhole.is_used.clone());
        let is_used = is_used
            .filter(|(view, _)| found.rig_from_board[view.pose_idx].is_some())
            .map(|(_, is_used)| is_used)
            .collect();
        let board_shape = BoardShape::default();
        let residuals = residuals(&found.rig, &rig_from_board, &board_shape, &used);
        let (noise, robust_weights) = weighted(&residuals, &used);
        Ok(Solution {
            method: self.name(),
            findings: Vec::new(),
            rig: found.rig,
            conversion_error_px: found.worst_error_px,
            rig_from_board,
            board_shape,
            observations: used,
            residuals,
            is_used,
            robust_weights,
            sigma_px: noise.variance_px2.sqrt(),
            costs: vec![pinhole.cost_px2],
            stop_reason: pinhole.stop.to_string(),
            settled: came_to_rest(pinhole.stop),
            choices: None,
            alternating: None,
            own: Box::new(PinholeRays::new(pinhole)),
        })
    }

    fn fit_some_poses(&self, training: &Observations, _: &Given) -> Result<Estimated, MethodError> {
        let pinhole = calibrate_rig(training, &settings())?;
        let found = pinhole.rig(&training.numbered_cameras(), training)?;
        Ok(Estimated {
            joint: None,
            rig: found.rig,
            board_shape: BoardShape::default(),
        })
    }
}

fn settings() -> RigSettings {
    RigSettings {
        adjustment: Settings {
            loss: Loss::StudentT,
            ..Settings::default()
        },
        ..RigSettings::default()
    }
}

/// Points by the pinholes themselves, wherever they have a ray; rig frame.
#[derive(Debug)]
pub struct PinholeRays {
    pinhole: PinholeRig,
    rig_from_first: RigidTransform,
}

impl PinholeRays {
    /// In the frame of the rig that [`PinholeRig::rig`] makes.
    pub fn new(pinhole: PinholeRig) -> Self {
        let datum = pinhole.first_from_board.iter().flatten().next();
        Self {
            rig_from_first: datum.map_or_else(RigidTransform::identity, RigidTransform::inverse),
            pinhole,
        }
    }
}

impl PointSource for PinholeRays {
    type Number = f64;

    fn cameras(&self) -> Vec<String> {
        (0..self.pinhole.cameras.len())
            .map(|k| k.to_string())
            .collect()
    }

    fn point(&self, sightings: &[Sighting<f64>]) -> Result<Point<f64>, Status> {
        let pixels: Vec<_> = sightings
            .iter()
            .map(|&(camera_idx, [u, v])| (camera_idx, PixelPoint::new(u, v)))
            .collect();
        let found = self.pinhole.triangulate(&pixels)?;
        Ok(Point {
            point_mm: self.rig_from_first.point(&found.point_mm).into(),
            gap_mm: found.gap_mm,
            sigma_mm: None,
        })
    }
}

impl Own for PinholeRays {
    fn rays(&self) -> Option<&dyn PointSource<Number = f64>> {
        Some(self)
    }
}
