//! Labels that contradict each other: what to suspect when no estimate could be found.
//!
//! Corners from a file come with labels that nobody has checked. The mistakes that happen are few
//! (a board numbered from the other end for one camera, an image mirrored, images of two cameras
//! that do not belong to the same pose), and each leaves a trace that can be seen without an
//! estimate. Used to explain a failure, never to refuse what can be calibrated.

use super::epipolar::{FundamentalMatrix, Match};
use super::pair_check::matches_of;
use crate::dataset::Dataset;
use calib_rays::observed::{Corner, View};
use calib_rays::remedy::Remedy;
use std::collections::BTreeMap;

/// Another labelling explains the corners if their median distance from the epipolar lines shrinks
/// by this factor.
const CLEAR_FACTOR: f64 = 3.0;
/// Cameras' poses are tried out of step by as much as this.
const MAX_STEPS: i64 = 3;

/// What is likely wrong with the labels.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LabelSuspicion {
    /// Some views see the board as in a mirror.
    #[error(
        "camera \"{camera}\" sees the board mirrored in pose {pose}: its rows and columns turn the \
         other way than those of camera \"{reference}\" in pose {reference_pose}"
    )]
    Mirrored {
        /// The camera of the first view that differs from most.
        camera: String,
        /// Its pose.
        pose: usize,
        /// The camera of a view like most.
        reference: String,
        /// Its pose.
        reference_pose: usize,
    },
    /// One camera's board is numbered from the opposite end.
    #[error(
        "the board is turned by 180 degrees in the labels of camera \"{camera}\": with its corners \
         numbered from the other end they would lie {turned_px:.2} px from those of camera \
         \"{reference}\", as they are it is {px:.2} px (median distance from the epipolar line)"
    )]
    TurnedCamera {
        /// The camera.
        camera: String,
        /// The first camera.
        reference: String,
        /// Distance as labelled.
        px: f64,
        /// Distance if turned.
        turned_px: f64,
    },
    /// The poses of one camera are counted differently.
    #[error(
        "pose k of camera \"{camera}\" seems to be pose k {steps:+} of camera \"{reference}\": so \
         they would fit to {shifted_px:.2} px, as they are to {px:.2} px (median distance from the \
         epipolar line)"
    )]
    OutOfStep {
        /// The camera.
        camera: String,
        /// The first camera.
        reference: String,
        /// What to add to the pose numbers.
        steps: i64,
        /// Distance as labelled.
        px: f64,
        /// Distance with other pose numbers.
        shifted_px: f64,
    },
}

impl Remedy for LabelSuspicion {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Mirrored { .. } => {
                "number rows and columns alike for all views, and use images as they came from the \
                 sensor; a camera that looks into a mirror cannot be calibrated with one that does not"
            }
            Self::TurnedCamera { .. } => {
                "turn the labels of that camera (row to rows - 1 - row, col to cols - 1 - col), or let \
                 calib-offline detect find the corners in all images"
            }
            Self::OutOfStep { .. } => {
                "number the poses alike in both cameras; an image may be missing in one of them"
            }
        };
        Some(text.to_owned())
    }
}

/// The most likely contradiction among the labels, if there is a clear one.
pub fn suspicious_labels(dataset: &Dataset, views: &[View]) -> Option<LabelSuspicion> {
    mirrored(dataset, views).or_else(|| {
        (1..dataset.cameras.len()).find_map(|camera_idx| {
            turned(dataset, views, camera_idx).or_else(|| out_of_step(dataset, views, camera_idx))
        })
    })
}

fn mirrored(dataset: &Dataset, views: &[View]) -> Option<LabelSuspicion> {
    let turning = |like_image: bool| -> Vec<&View> {
        let fits = |view: &&View| turns_like_image(&view.corners) == Some(like_image);
        views.iter().filter(fits).collect()
    };
    let (right, left) = (turning(true), turning(false));
    let (most, fewer) = if right.len() >= left.len() {
        (right, left)
    } else {
        (left, right)
    };
    let (odd, usual) = (fewer.first()?, most.first()?);
    let name = |view: &View| dataset.cameras[view.camera_idx].name.clone();
    Some(LabelSuspicion::Mirrored {
        camera: name(odd),
        pose: odd.pose,
        reference: name(usual),
        reference_pose: usual.pose,
    })
}

/// Whether columns and rows turn as u and v do; `None` if the corners do not say. The sign of the
/// determinant of the best affine map from (col, row) to (u, v).
pub fn turns_like_image(corners: &[Corner]) -> Option<bool> {
    let count = corners.len() as f64;
    let mean = |of: fn(&Corner) -> f64| corners.iter().map(of).sum::<f64>() / count;
    let (mx, my) = (mean(|c| c.col as f64), mean(|c| c.row as f64));
    let (mu, mv) = (mean(|c| c.pixel.u), mean(|c| c.pixel.v));
    // Sums of products about the means; the normal matrix is positive and does not change the sign.
    let (mut xu, mut xv, mut yu, mut yv) = (0.0, 0.0, 0.0, 0.0);
    for c in corners {
        let (x, y) = (c.col as f64 - mx, c.row as f64 - my);
        let (u, v) = (c.pixel.u - mu, c.pixel.v - mv);
        xu += x * u;
        xv += x * v;
        yu += y * u;
        yv += y * v;
    }
    let determinant = xu * yv - xv * yu;
    (determinant != 0.0 && determinant.is_finite()).then_some(determinant > 0.0)
}

fn turned(dataset: &Dataset, views: &[View], camera_idx: usize) -> Option<LabelSuspicion> {
    let px = distance_px(views, camera_idx, 0)?;
    let board = &dataset.board;
    let turned_views: Vec<View> = views
        .iter()
        .cloned()
        .map(|mut view| {
            if view.camera_idx == camera_idx {
                for corner in &mut view.corners {
                    (corner.row, corner.col) = board.half_turned(corner.row, corner.col);
                }
            }
            view
        })
        .collect();
    let turned_px = distance_px(&turned_views, camera_idx, 0)?;
    (CLEAR_FACTOR * turned_px < px).then(|| LabelSuspicion::TurnedCamera {
        camera: dataset.cameras[camera_idx].name.clone(),
        reference: dataset.cameras[0].name.clone(),
        px,
        turned_px,
    })
}

fn out_of_step(dataset: &Dataset, views: &[View], camera_idx: usize) -> Option<LabelSuspicion> {
    let px = distance_px(views, camera_idx, 0)?;
    let (steps, shifted_px) = (-MAX_STEPS..=MAX_STEPS)
        .filter(|steps| *steps != 0)
        .filter_map(|steps| Some((steps, distance_px(views, camera_idx, steps)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    (CLEAR_FACTOR * shifted_px < px).then(|| LabelSuspicion::OutOfStep {
        camera: dataset.cameras[camera_idx].name.clone(),
        reference: dataset.cameras[0].name.clone(),
        steps,
        px,
        shifted_px,
    })
}

/// Median distance of a camera's corners from the epipolar lines of the first camera's, px, if
/// the camera's pose numbers grow by `steps`; `None` with fewer than two common poses.
fn distance_px(views: &[View], camera_idx: usize, steps: i64) -> Option<f64> {
    let first: BTreeMap<usize, &View> = views
        .iter()
        .filter(|view| view.camera_idx == 0)
        .map(|view| (view.pose, view))
        .collect();
    let pairs: Vec<Vec<Match>> = views
        .iter()
        .filter(|view| view.camera_idx == camera_idx)
        .filter_map(|view| {
            let pose = i64::try_from(view.pose).ok()?.checked_add(steps)?;
            let other = first.get(&usize::try_from(pose).ok()?)?;
            Some(matches_of(other, view))
        })
        .collect();
    if pairs.len() < 2 {
        return None;
    }
    let matches: Vec<Match> = pairs.into_iter().flatten().collect();
    FundamentalMatrix::from_matches(&matches)?.median_distance_px(&matches)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::CameraSpec;
    use calib_rays::board::BoardSpec;
    use calib_rays::geometry::{PixelPoint, SensorSize, so3};
    use nalgebra::Vector3;

    const BOARD: BoardSpec = BoardSpec {
        rows: 6,
        cols: 9,
        square_mm: 25.0,
    };

    fn dataset() -> Dataset {
        let camera = |name: &str| CameraSpec {
            name: name.to_owned(),
            sensor: SensorSize::new(640, 480),
            images: Vec::new(),
            optics: None,
            serial: None,
        };
        Dataset {
            folder: ".".into(),
            board: BOARD,
            cameras: vec![camera("left"), camera("right")],
            stage: None,
            excluded_poses: [].into(),
            target: None,
            certificate: None,
            recording: None,
        }
    }

    /// Six tilted boards some 30 cm away from two cameras 83 mm apart.
    fn views() -> Vec<View> {
        let corner = |camera_idx: usize, pose: usize, row: usize, col: usize| {
            let tilt = 0.25 * pose as f64 - 0.6;
            let rotation = so3::exp(&Vector3::new(tilt, 0.6 * tilt * tilt, 0.1));
            let on_board = BOARD.corner_in_board(row, col) - BOARD.center_in_board();
            let away = Vector3::new(
                60.0 * tilt - 83.0 * camera_idx as f64,
                0.0,
                300.0 + 80.0 * tilt,
            );
            let p = rotation * on_board + away;
            Corner {
                row,
                col,
                pixel: PixelPoint::new(320.0 + 530.0 * p.x / p.z, 240.0 + 530.0 * p.y / p.z),
                sigma_px: None,
            }
        };
        let view = |k: usize| View {
            camera_idx: k % 2,
            pose: k / 2,
            corners: (0..54)
                .map(|n| corner(k % 2, k / 2, n / 9, n % 9))
                .collect(),
        };
        (0..12).map(view).collect()
    }

    fn of_right(views: &mut [View]) -> impl Iterator<Item = &mut View> {
        views.iter_mut().filter(|view| view.camera_idx == 1)
    }

    #[test]
    fn labels_that_belong_together_are_not_suspected() {
        assert_eq!(suspicious_labels(&dataset(), &views()), None);
    }

    #[test]
    fn one_mirrored_view_is_named() {
        let mut views = views();
        for corner in &mut views[7].corners {
            corner.pixel.u = 639.0 - corner.pixel.u;
        }
        let suspicion = suspicious_labels(&dataset(), &views).unwrap();
        let words = "camera \"right\" sees the board mirrored in pose 3";
        assert!(suspicion.to_string().contains(words), "{suspicion}");
    }

    #[test]
    fn a_camera_numbered_from_the_other_end_is_named() {
        let mut views = views();
        for corner in of_right(&mut views).flat_map(|view| &mut view.corners) {
            (corner.row, corner.col) = BOARD.half_turned(corner.row, corner.col);
        }
        let suspicion = suspicious_labels(&dataset(), &views).unwrap();
        assert!(
            matches!(&suspicion, LabelSuspicion::TurnedCamera { camera, .. } if camera == "right"),
            "{suspicion}"
        );
    }

    #[test]
    fn cameras_out_of_step_are_named() {
        let mut views = views();
        of_right(&mut views).for_each(|view| view.pose += 2);
        let suspicion = suspicious_labels(&dataset(), &views).unwrap();
        assert!(
            matches!(suspicion, LabelSuspicion::OutOfStep { steps: -2, .. }),
            "{suspicion}"
        );
    }
}
