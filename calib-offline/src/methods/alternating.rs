//! The published procedure as a method.

use super::solution::{placed_part, positive, weighted};
use super::{Given, Method, MethodError, Own, Solution};
use crate::report::record::AlternatingRecord;
use calib_estimate::adjust::Observations;
use calib_estimate::alternating::alternation::{Alternated, AlternationStop};
use calib_estimate::alternating::field_rig::FieldRig;
use calib_estimate::alternating::{
    AlternatingError, AlternatingEstimate, AlternatingSettings, estimate,
};
use calib_estimate::init::rig::{RigStart, start_rig};
use calib_estimate::reprojection::residuals;
use calib_judge::held_out::Estimated;
use calib_rays::board::BoardShape;
use calib_rays::field::{BaseLens, MeasureError, RayTable, Rig};
use calib_rays::geometry::{PixelPoint, Ray, SensorSize, triangulate_pair, triangulate_rays};
use calib_rays::measure::{Point, PointSource, Sighting, Status};
use calib_rays::progress::Progress;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Rays of single pixels and poses in turn, as published.
#[derive(Debug, Clone, Copy)]
pub struct Alternating;

impl Method for Alternating {
    fn name(&self) -> &'static str {
        "alternating"
    }

    fn title(&self) -> &'static str {
        "rays one by one, alternating"
    }

    /// Screens and estimates. Corners count where the joint estimate's weights would keep them.
    fn fit(&self, given: &Given, progress: &dyn Progress) -> Result<Solution, MethodError> {
        MethodError::check_board(self.title(), &given.observations.board)?;
        progress.begin("initialize", 1);
        let start = start_rig(given.observations)?;
        progress.end();

        progress.begin("estimate", 1);
        let (found, fields) = estimate_rig(&start, given.names, given.placements)?;
        progress.end();

        let (used, rig_from_board) = placed_part(&found.observations, &found.rig_from_board);
        let board_shape = BoardShape::default();
        let mut residuals = residuals(&fields.rig, &rig_from_board, &board_shape, &used);
        // The networks learn corners beyond the calibrated area too.
        let (_, weights) = weighted(&residuals, &used);
        drop_outside(&fields.rig, &used, &mut residuals);
        let (noise, robust_weights) = weighted(&residuals, &used);
        Ok(Solution {
            method: self.name(),
            findings: start.findings,
            // Of single rays, which carry noise that the field does not.
            conversion_error_px: fields.rms_error_px.iter().copied().fold(0.0, f64::max),
            alternating: Some(record(&found, &fields)),
            rig: fields.rig,
            rig_from_board,
            board_shape,
            observations: used,
            residuals,
            is_used: positive(&weights),
            robust_weights,
            sigma_px: noise.variance_px2.sqrt(),
            costs: found.alternated.rms_mm.clone(),
            stop_reason: stop_reason(&found.alternated),
            settled: found.alternated.still_falling().is_none(),
            choices: None,
            own: Box::new(SingleRays(found)),
        })
    }

    fn fit_some_poses(
        &self,
        training: &Observations,
        given: &Given,
    ) -> Result<Estimated, MethodError> {
        let start = start_rig(training)?;
        let names = training.numbered_cameras();
        let (_, fields) = estimate_rig(&start, &names, given.placements)?;
        Ok(Estimated {
            joint: None,
            rig: fields.rig,
            board_shape: BoardShape::default(),
        })
    }
}

/// The published procedure from a start, and its cameras as fields.
fn estimate_rig(
    start: &RigStart,
    names: &[String],
    placements: &BTreeMap<usize, usize>,
) -> Result<(AlternatingEstimate, FieldRig), AlternatingError> {
    let placement = |pose: usize| placements.get(&pose).copied();
    let found = estimate(start, &placement, &AlternatingSettings::default())?;
    let bases: Vec<BaseLens> = start.fields.iter().map(|field| field.base).collect();
    let fields = found
        .rig(names, &bases)
        .ok_or(AlternatingError::FewBoards)?;
    Ok((found, fields))
}

/// Points by the rays of single pixels, before they are smoothed into fields; rig frame.
#[derive(Debug)]
pub struct SingleRays(pub AlternatingEstimate);

impl PointSource for SingleRays {
    type Number = f64;

    fn cameras(&self) -> Vec<String> {
        self.0.observations.numbered_cameras()
    }

    fn point(&self, sightings: &[Sighting<f64>]) -> Result<Point<f64>, Status> {
        let ray = |&(camera_idx, [u, v]): &Sighting<f64>| {
            let source = self.0.cameras.get(camera_idx)?;
            Some(source.ray(PixelPoint::new(u, v))?.ray)
        };
        let rays: Option<Vec<Ray>> = sightings.iter().map(ray).collect();
        let rays = rays.ok_or(Status::Outside)?;
        let found = match &rays[..] {
            [a, b] => triangulate_pair(a, b),
            all => triangulate_rays(all),
        };
        let found = found.map_err(MeasureError::from)?;
        Ok(Point {
            point_mm: found.point_mm.into(),
            gap_mm: found.gap_mm,
            sigma_mm: None,
        })
    }
}

impl Own for SingleRays {
    fn rays(&self) -> Option<&dyn PointSource<Number = f64>> {
        Some(self)
    }

    fn ray_table(&self, camera_idx: usize, sensor: SensorSize) -> Option<RayTable> {
        Some(self.0.cameras.get(camera_idx)?.table(sensor))
    }
}

/// Leaves corners outside the calibrated area without a residual: no pixel there has a ray, and what
/// a smooth field says of it would pass for an outlier.
fn drop_outside(
    rig: &Rig,
    observations: &Observations,
    residuals: &mut [Vec<Option<Vector2<f64>>>],
) {
    for (view, residuals) in observations.views.iter().zip(residuals) {
        let camera = rig.cameras.get(view.camera_idx);
        for (corner, residual) in view.corners.iter().zip(residuals) {
            if !camera.is_some_and(|camera| camera.coverage.contains(corner.pixel)) {
                *residual = None;
            }
        }
    }
}

fn stop_reason(alternated: &Alternated) -> String {
    let sweeps = alternated.rms_mm.len().saturating_sub(1);
    let stop = match alternated.stop {
        AlternationStop::StepBelowLimit => {
            format!("stopped after {sweeps} sweeps: no control point moves any more by what counts")
        }
        AlternationStop::SweepLimit => format!("stopped at the limit of {sweeps} sweeps"),
    };
    match alternated.still_falling() {
        None => stop,
        Some(share) => format!(
            "{stop}, with the cost still falling ({:.1} % in the last tenth of them): the poses are not \
             where they would come to rest",
            100.0 * share
        ),
    }
}

fn record(found: &AlternatingEstimate, fields: &FieldRig) -> AlternatingRecord {
    AlternatingRecord {
        spread: found.spread.clone(),
        starts: found.starts.clone(),
        circles: found.circles.clone(),
        projected: found.projected,
        sweeps: found.alternated.rms_mm.len().saturating_sub(1),
        last_step_mm: found.alternated.last_step_mm,
        still_falling: found.alternated.still_falling(),
        field_rms_error_px: fields.rms_error_px.clone(),
    }
}
