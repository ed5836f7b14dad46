//! Poses and rays in turn (paper section 1.3, Eqs. 13 to 19, 29, 30).
//!
//! Rays are fitted to the control points with the poses held, then every pose is moved to the foot
//! points of its control points with the rays held; the datum pose stays. Each half lowers the cost
//! (14), the sum of squared distances of control points from their rays.
//!
//! The alternation converges linearly, and slowly: its step falls below any useful limit long before
//! the cost does (METHOD 1.1). [`Alternated::still_falling`] says so.

use super::line_fit::fit_line;
use super::pose_step::{Pull, closed_form_step, moved};
use crate::geometry::{PixelPoint, Ray, RigidTransform};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Fewest poses that a pixel must see to have a say about them: two points always have a line.
pub const MIN_POSES_PER_PIXEL: usize = 3;

/// Where one pixel looks on each board.
#[derive(Debug, Clone)]
pub struct PixelControl {
    /// The pixel.
    pub pixel: PixelPoint,
    /// (pose index, point in the board's frame, mm).
    pub boards: Vec<(usize, Vector3<f64>)>,
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlternationSettings {
    /// Most sweeps over rays and poses.
    pub sweeps: usize,
    /// Stop when no control point moved by more than this in a sweep, mm.
    pub step_mm: f64,
}

/// Why the alternation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AlternationStop {
    /// No pose moves any more by what counts.
    StepBelowLimit,
    /// The allowed number of sweeps is used up.
    SweepLimit,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct Alternated {
    /// Per pose index; `None` as it came.
    pub poses: Vec<Option<RigidTransform>>,
    /// RMS distance of control points from their rays at the start and after each sweep, mm.
    pub rms_mm: Vec<f64>,
    /// Why it ended.
    pub stop: AlternationStop,
    /// Farthest that a control point moved in the last sweep, mm.
    pub last_step_mm: f64,
}

/// A cost that falls by more than this share in a tenth of the sweeps has not come to rest.
const AT_REST: f64 = 1e-3;

impl Alternated {
    /// The share by which the RMS fell over the last tenth of the sweeps, if that is not at rest yet.
    pub fn still_falling(&self) -> Option<f64> {
        let last = *self.rms_mm.last()?;
        let back = (self.rms_mm.len() / 10).max(1);
        let before = *self.rms_mm.get(self.rms_mm.len().checked_sub(1 + back)?)?;
        let share = 1.0 - last / before;
        (share > AT_REST).then_some(share)
    }
}

/// Control points of a pixel in the frame of the poses.
pub fn control_points(
    control: &PixelControl,
    poses: &[Option<RigidTransform>],
) -> Vec<(usize, Vector3<f64>, Vector3<f64>)> {
    control
        .boards
        .iter()
        .filter_map(|(pose_idx, point)| {
            // (1), (18)
            let theta = poses.get(*pose_idx)?.as_ref()?;
            Some((*pose_idx, *point, theta.point(point)))
        })
        .collect()
}

/// The ray of a pixel (15, 16); `None` if it sees fewer than `least` placed boards.
pub fn ray_of(control: &PixelControl, poses: &[Option<RigidTransform>], least: usize) -> Option<Ray> {
    let points: Vec<Vector3<f64>> = control_points(control, poses)
        .into_iter()
        .map(|(_, _, point)| point)
        .collect();
    (points.len() >= least).then(|| fit_line(&points)).flatten()
}

/// Alternates. `cameras` holds the pixels of each camera, all in the frame of the poses; the pose
/// `datum` does not move.
///
/// Cost: a singular value decomposition per pixel and a few 3 x 3 products per control point and
/// sweep.
pub fn alternate(
    cameras: &[&[PixelControl]],
    start: &[Option<RigidTransform>],
    datum: usize,
    settings: &AlternationSettings,
) -> Alternated {
    let mut poses = start.to_vec();
    let mut rms_mm = Vec::new();
    let mut stop = AlternationStop::SweepLimit;
    let mut last_step_mm = 0.0;
    for _ in 0..settings.sweeps {
        let (pulls, rms) = pulls(cameras, &poses);
        rms_mm.push(rms);
        last_step_mm = 0.0;
        for (pose_idx, pulls) in pulls.iter().enumerate() {
            let placed = poses.get_mut(pose_idx).and_then(Option::as_mut);
            let Some(theta) = placed.filter(|_| pose_idx != datum) else {
                continue;
            };
            let Some(eps) = closed_form_step(theta, pulls) else {
                continue;
            };
            let next = moved(theta, &eps);
            last_step_mm = pulls
                .iter()
                .map(|pull| (next.point(&pull.board_mm) - theta.point(&pull.board_mm)).norm())
                .fold(last_step_mm, f64::max);
            *theta = next;
        }
        if last_step_mm < settings.step_mm {
            stop = AlternationStop::StepBelowLimit;
            break;
        }
    }
    rms_mm.push(pulls(cameras, &poses).1);
    Alternated {
        poses,
        rms_mm,
        stop,
        last_step_mm,
    }
}

/// The foot points (29) of all control points by pose, and the RMS distance from them (14), mm.
fn pulls(
    cameras: &[&[PixelControl]],
    poses: &[Option<RigidTransform>],
) -> (Vec<Vec<Pull>>, f64) {
    let mut by_pose: Vec<Vec<Pull>> = vec![Vec::new(); poses.len()];
    let (mut squared, mut count) = (0.0, 0.0);
    for camera in cameras {
        // In the pixels' order, whatever the number of threads.
        let rays: Vec<Option<Ray>> = camera
            .par_iter()
            .map(|control| ray_of(control, poses, MIN_POSES_PER_PIXEL))
            .collect();
        for (control, ray) in camera.iter().zip(rays) {
            let Some(ray) = ray else { continue };
            for (pose_idx, board_mm, point) in control_points(control, poses) {
                let foot_mm = ray.foot_point(&point);
                squared += (foot_mm - point).norm_squared();
                count += 1.0;
                by_pose[pose_idx].push(Pull {
                    board_mm,
                    foot_mm,
                    weight: 1.0,
                });
            }
        }
    }
    (by_pose, (squared / f64::max(count, 1.0)).sqrt())
}
