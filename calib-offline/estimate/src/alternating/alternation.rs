//! Poses and rays in turn (paper section 1.3, Eqs. 13 to 19, 29, 30).
//!
//! Rays are fitted to the control points with the poses held, then every pose is moved to the foot
//! points of its control points with the rays held; the datum pose stays. Each half lowers the cost
//! (14), the sum of squared distances of control points from their rays.
//!
//! The alternation converges linearly, and slowly: its step falls below any useful limit long before
//! the cost does (METHOD 1.1). [`Alternated::still_falling`] says so.

use super::line_fit::fit_line;
use super::mixing::Mixing;
use super::pose_step::{Pull, closed_form_step, moved};
use calib_rays::geometry::{Ray, RigidTransform, so3};
use nalgebra::{DVector, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Fewest boards that a pixel must see: two points always have a line, however wrong.
pub const MIN_BOARDS: usize = 3;
/// Least standard deviation of a pixel's control points along its ray, as a share of the boards'
/// distance: points in one place determine no direction.
pub const MIN_DEPTH_SHARE: f64 = 0.01;

/// Where one pixel looks on each board.
#[derive(Debug, Clone)]
pub struct PixelControl {
    /// (pose index, point in the board's frame, mm).
    pub boards: Vec<(usize, Vector3<f64>)>,
}

/// The pixels of one camera, and where it is about.
#[derive(Debug, Clone)]
pub struct CameraControl {
    /// Pixels.
    pub pixels: Vec<PixelControl>,
    /// Place of the camera, frame of the poses, mm.
    pub place_mm: Vector3<f64>,
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlternationSettings {
    /// Most sweeps over rays and poses.
    pub sweeps: usize,
    /// Stop when no control point moved by more than this in a sweep, mm.
    pub step_mm: f64,
    /// How many earlier sweeps are mixed into the next start; 0 is the publication's plain
    /// alternation.
    pub mixing: usize,
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

/// The line of points (15, 16), if they support one: at least [`MIN_BOARDS`] of them, with a standard
/// deviation along it of [`MIN_DEPTH_SHARE`] of their distance from the camera.
pub fn supported_line(points: &[Vector3<f64>], place_mm: &Vector3<f64>) -> Option<Ray> {
    if points.len() < MIN_BOARDS {
        return None;
    }
    let line = fit_line(points)?;
    let squared: f64 = points
        .iter()
        .map(|point| (point - line.origin_mm).dot(&line.direction).powi(2))
        .sum();
    let deviation = (squared / points.len() as f64).sqrt();
    (deviation >= MIN_DEPTH_SHARE * (line.origin_mm - place_mm).norm()).then_some(line)
}

/// Alternates. The boards' poses are common to all `cameras`: each is pulled by the rays of all that
/// see it. The pose `datum` does not move.
///
/// Cost: a singular value decomposition per pixel and a few 3 x 3 products per control point and
/// sweep.
pub fn alternate(
    cameras: &[CameraControl],
    start: &[Option<RigidTransform>],
    datum: usize,
    settings: &AlternationSettings,
) -> Alternated {
    let chart = Chart { start, datum };
    let mut mixing = Mixing::new(settings.mixing);
    let mut poses = start.to_vec();
    let (mut feet, mut rms) = pulls(cameras, &poses);
    let mut rms_mm = vec![rms];
    let mut stop = AlternationStop::SweepLimit;
    let mut last_step_mm = 0.0;
    for _ in 0..settings.sweeps {
        let (swept, step_mm) = sweep(&poses, &feet, datum);
        last_step_mm = step_mm;
        let mixed = if settings.mixing > 0 {
            let next = mixing.next(&chart.numbers(&poses), &chart.numbers(&swept));
            chart.poses(&next)
        } else {
            swept.clone()
        };
        let (mut next_feet, mut next_rms) = pulls(cameras, &mixed);
        poses = mixed;
        // A sweep never raises the cost; a mixture may.
        if settings.mixing > 0 && !(next_rms <= rms) {
            mixing.clear();
            (next_feet, next_rms) = pulls(cameras, &swept);
            poses = swept;
        }
        (feet, rms) = (next_feet, next_rms);
        rms_mm.push(rms);
        if step_mm < settings.step_mm {
            stop = AlternationStop::StepBelowLimit;
            break;
        }
    }
    Alternated {
        poses,
        rms_mm,
        stop,
        last_step_mm,
    }
}

/// All poses moved to the feet of their control points (26, 30), and the farthest that a control
/// point moved, mm.
fn sweep(
    poses: &[Option<RigidTransform>],
    feet: &[Vec<Pull>],
    datum: usize,
) -> (Vec<Option<RigidTransform>>, f64) {
    let mut farthest_mm = 0.0;
    let swept = poses
        .iter()
        .zip(feet)
        .enumerate()
        .map(|(pose_idx, (pose, feet))| {
            let theta = (*pose)?;
            if pose_idx == datum {
                return Some(theta);
            }
            let Some(eps) = closed_form_step(&theta, feet) else {
                return Some(theta);
            };
            let next = moved(&theta, &eps);
            farthest_mm = feet
                .iter()
                .map(|foot| (next.point(&foot.board_mm) - theta.point(&foot.board_mm)).norm())
                .fold(farthest_mm, f64::max);
            Some(next)
        })
        .collect();
    (swept, farthest_mm)
}

/// Poses as a vector of numbers about those at the start: rotation vector times [`Chart::ARM_MM`]
/// and shift, mm.
struct Chart<'a> {
    start: &'a [Option<RigidTransform>],
    datum: usize,
}

impl Chart<'_> {
    /// What makes a turn comparable with a shift: about the reach of a board from its middle.
    const ARM_MM: f64 = 100.0;

    /// The poses that move, with their starts.
    fn moving(&self) -> impl Iterator<Item = (usize, &RigidTransform)> {
        self.start
            .iter()
            .enumerate()
            .filter(|(pose_idx, _)| *pose_idx != self.datum)
            .filter_map(|(pose_idx, pose)| Some((pose_idx, pose.as_ref()?)))
    }

    fn numbers(&self, poses: &[Option<RigidTransform>]) -> DVector<f64> {
        let numbers: Vec<f64> = self
            .moving()
            .flat_map(|(pose_idx, start)| {
                let pose = poses[pose_idx].unwrap_or(*start);
                let turn = so3::log(&(pose.rotation * start.rotation.transpose())) * Self::ARM_MM;
                let shift = pose.translation_mm - start.translation_mm;
                [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
            })
            .collect();
        DVector::from_vec(numbers)
    }

    fn poses(&self, numbers: &DVector<f64>) -> Vec<Option<RigidTransform>> {
        let mut poses = self.start.to_vec();
        for (k, (pose_idx, start)) in self.moving().enumerate() {
            let turn = numbers.fixed_rows::<3>(6 * k) / Self::ARM_MM;
            let shift = numbers.fixed_rows::<3>(6 * k + 3).into_owned();
            poses[pose_idx] = Some(start.perturbed(&turn, &shift));
        }
        poses
    }
}

/// RMS distance of control points from their rays (14) with given poses, mm; `None` if no pixel
/// supports a ray.
pub fn rms_mm(cameras: &[CameraControl], poses: &[Option<RigidTransform>]) -> Option<f64> {
    let (feet, rms) = pulls(cameras, poses);
    feet.iter().any(|feet| !feet.is_empty()).then_some(rms)
}

/// The foot points (29) of all control points by pose, and the RMS distance from them (14), mm.
fn pulls(cameras: &[CameraControl], poses: &[Option<RigidTransform>]) -> (Vec<Vec<Pull>>, f64) {
    let mut by_pose: Vec<Vec<Pull>> = vec![Vec::new(); poses.len()];
    let (mut squared, mut count) = (0.0, 0.0);
    for camera in cameras {
        // In the pixels' order, whatever the number of threads.
        let feet: Vec<Vec<(usize, Pull)>> = camera
            .pixels
            .par_iter()
            .map(|control| feet_of(control, poses, &camera.place_mm))
            .collect();
        for (pose_idx, pull) in feet.into_iter().flatten() {
            let point = poses[pose_idx].map_or(pull.foot_mm, |theta| theta.point(&pull.board_mm));
            squared += (pull.foot_mm - point).norm_squared();
            count += 1.0;
            by_pose[pose_idx].push(pull);
        }
    }
    (by_pose, (squared / f64::max(count, 1.0)).sqrt())
}

/// The foot points (29) of one pixel's control points on its ray (15, 16), by pose index; none if
/// they support no ray.
fn feet_of(
    control: &PixelControl,
    poses: &[Option<RigidTransform>],
    place_mm: &Vector3<f64>,
) -> Vec<(usize, Pull)> {
    let controls = control_points(control, poses);
    let points: Vec<Vector3<f64>> = controls.iter().map(|(_, _, point)| *point).collect();
    let Some(line) = supported_line(&points, place_mm) else {
        return Vec::new();
    };
    controls
        .into_iter()
        .map(|(pose_idx, board_mm, point)| {
            let pull = Pull {
                board_mm,
                foot_mm: line.foot_point(&point),
                weight: 1.0,
            };
            (pose_idx, pull)
        })
        .collect()
}
