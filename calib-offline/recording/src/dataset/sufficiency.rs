//! Whether the corners could determine a calibration at all: cheap counts before any estimate.

use super::Dataset;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::Scatter;
use calib_rays::observed::{Corner, MIN_POSES, View, poses};
use calib_rays::remedy::Remedy;
use nalgebra::Vector3;

/// Corners of a view lie on a line if their scatter across it is below this share of the scatter
/// along it. A board seen at 89 degrees still has a share of 1e-2.
const MIN_SCATTER_SHARE: f64 = 1e-3;

/// Two views are the same if their common corners are no further apart than this (RMS), px. Corner
/// noise alone stays below it; the smallest step of a stage moves corners by more.
const SAME_VIEW_PX: f64 = 1.0;

/// Fewest points of a solid target: two numbers each for six of the pose and nine of a plain lens.
const FEWEST_POINTS: usize = 8;

/// Why the corners cannot determine a calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SufficiencyError {
    /// No camera saw anything.
    #[error("there are no corners")]
    NoCorners,
    /// Too few poses.
    #[error("camera \"{camera}\" saw the board in {have} usable {}, at least {need} are needed{}", if *have == 1 { "pose" } else { "poses" }, if *unusable == 0 { String::new() } else { format!(" ({unusable} more cannot be used: their corners lie on a line or in one row or column)") })]
    TooFewPoses {
        /// The camera.
        camera: String,
        /// Poses seen with corners that spread over the plane.
        have: usize,
        /// Poses seen without.
        unusable: usize,
        /// How many it takes.
        need: usize,
    },
    /// A camera of a target of known places, or of known poses, without any corner.
    #[error(
        "camera \"{camera}\" saw nothing: it has no line in {}",
        Dataset::CORNERS
    )]
    Blind {
        /// The camera.
        camera: String,
    },
    /// Fewer points of a solid target than a lens and a pose have numbers for.
    #[error(
        "camera \"{camera}\" saw {have} points; one pose determines a camera with {need} at the least"
    )]
    FewPoints {
        /// The camera.
        camera: String,
        /// Points seen.
        have: usize,
        /// How many it takes.
        need: usize,
    },
    /// Points in one plane, seen in too few poses.
    #[error("camera \"{camera}\" saw points that lie in one plane, in {have} {}; its focal length cannot be told from its distance", if *have == 1 { "pose" } else { "poses" })]
    Flat {
        /// The camera.
        camera: String,
        /// Poses seen.
        have: usize,
        /// How many it takes of a flat target.
        need: usize,
    },
    /// The board did not move.
    #[error("camera \"{camera}\" saw the board {views} times, but in no more than {different} different {}, at least {need} are needed", if *different == 1 { "place" } else { "places" })]
    SameView {
        /// The camera.
        camera: String,
        /// Usable views.
        views: usize,
        /// Views that differ from each other.
        different: usize,
        /// How many it takes.
        need: usize,
    },
    /// Every view of a camera is a line.
    #[error("all corners of camera \"{camera}\" lie on a line in each of its {views} views")]
    OnALine {
        /// The camera.
        camera: String,
        /// Its views.
        views: usize,
    },
    /// Two cameras that no chain of common poses connects.
    #[error(
        "camera \"{camera}\" shares no usable pose with camera \"{reference}\", not even through another camera"
    )]
    NotConnected {
        /// The camera left over.
        camera: String,
        /// The first camera.
        reference: String,
    },
}

impl Remedy for SufficiencyError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::NoCorners => {
                "check with calib-offline inspect, and look at the images with detect --overlay"
            }
            Self::TooFewPoses { .. } => {
                "record at least ten poses at different tilts and distances, with the board over the whole image"
            }
            Self::Blind { .. } => {
                "add its corners under that name, or leave its [[camera]] out of dataset.toml"
            }
            Self::FewPoints { .. } => {
                "add points over the whole image and over all depths: some fifty hold a lens well"
            }
            Self::Flat { need, .. } => {
                return Some(format!(
                    "add points off that plane, or at least {need} poses of it at different tilts, or say with [poses] known how it was moved"
                ));
            }
            Self::SameView { .. } => {
                "move and tilt the board between the images; the same image again says nothing new"
            }
            Self::OnALine { .. } => {
                "the board must be seen from its face, and corners of several rows and columns must be given"
            }
            Self::NotConnected { .. } => {
                "record poses that both cameras see, or calibrate the cameras apart"
            }
        };
        Some(text.to_owned())
    }
}

/// Checks that every camera saw enough poses, and that common poses connect all cameras.
///
/// # Errors
/// [`SufficiencyError`].
pub fn check_sufficiency(dataset: &Dataset, views: &[View]) -> Result<(), SufficiencyError> {
    if views.is_empty() {
        return Err(SufficiencyError::NoCorners);
    }
    let mut usable = vec![Vec::new(); dataset.cameras.len()];
    for (camera_idx, camera) in dataset.cameras.iter().enumerate() {
        let of_camera: Vec<View> = views
            .iter()
            .filter(|view| view.camera_idx == camera_idx)
            .cloned()
            .collect();
        let (good, lines): (Vec<View>, Vec<View>) = of_camera
            .into_iter()
            .partition(|view| spreads_over_plane(&dataset.board, &view.corners));
        let have = poses(&good).len();
        let is_known = !dataset.board.layout.is_grid() || !dataset.known_poses.is_empty();
        if is_known && good.is_empty() && lines.is_empty() {
            return Err(SufficiencyError::Blind {
                camera: camera.name.clone(),
            });
        }
        if have == 0 && !lines.is_empty() {
            return Err(SufficiencyError::OnALine {
                camera: camera.name.clone(),
                views: lines.len(),
            });
        }
        if is_solid(dataset, &good) {
            let points = good.iter().map(|view| view.corners.len()).sum();
            if have < MIN_POSES && points < FEWEST_POINTS {
                return Err(SufficiencyError::FewPoints {
                    camera: camera.name.clone(),
                    have: points,
                    need: FEWEST_POINTS,
                });
            }
            usable[camera_idx] = good;
            continue;
        }
        if have < MIN_POSES && !dataset.board.layout.is_grid() {
            return Err(SufficiencyError::Flat {
                camera: camera.name.clone(),
                have,
                need: MIN_POSES,
            });
        }
        if have < MIN_POSES {
            return Err(SufficiencyError::TooFewPoses {
                camera: camera.name.clone(),
                have,
                unusable: lines.len(),
                need: MIN_POSES,
            });
        }
        let different = different_views(&good);
        if different < MIN_POSES {
            return Err(SufficiencyError::SameView {
                camera: camera.name.clone(),
                views: good.len(),
                different,
                need: MIN_POSES,
            });
        }
        usable[camera_idx] = good;
    }
    check_connected(dataset, &usable)
}

/// Whether the corners of one view fix its homography: four corners that spread over the board
/// and over the image.
pub fn spreads_over_plane(board: &BoardSpec, corners: &[Corner]) -> bool {
    let in_image = corners.iter().map(|c| (c.pixel.u, c.pixel.v));
    let on_board = if board.layout.is_grid() {
        let labels = corners.iter().map(|c| (c.col as f64, c.row as f64));
        scatter_share(labels) > MIN_SCATTER_SHARE
    } else {
        let places: Vec<_> = places(board, corners).collect();
        !Scatter::of(&places).is_line()
    };
    corners.len() >= 4 && on_board && scatter_share(in_image) > MIN_SCATTER_SHARE
}

fn places<'a>(
    board: &'a BoardSpec,
    corners: &'a [Corner],
) -> impl Iterator<Item = Vector3<f64>> + 'a {
    corners.iter().map(|c| board.corner_in_board(c.row, c.col))
}

/// Whether one rigid target shows a camera points that lie in no plane: in one view, or in several whose poses
/// are known. Then a single pose determines the camera.
fn is_solid(dataset: &Dataset, views: &[View]) -> bool {
    let mut known = Vec::new();
    for view in views {
        let places = places(&dataset.board, &view.corners);
        match dataset.known_poses.get(&view.pose) {
            Some(pose) => known.extend(places.map(|place| pose.rig_from_board.point(&place))),
            None if Scatter::of(&places.collect::<Vec<_>>()).is_solid() => return true,
            None => {}
        }
    }
    Scatter::of(&known).is_solid()
}

/// How many of one camera's views differ from each other; counted up to [`MIN_POSES`].
fn different_views(views: &[View]) -> usize {
    let mut different: Vec<&View> = Vec::new();
    for view in views {
        if different.iter().all(|other| !same_view(view, other)) {
            different.push(view);
        }
        if different.len() == MIN_POSES {
            break;
        }
    }
    different.len()
}

/// Whether two views show the same corners at the same pixels. Corners come in (row, col) order.
fn same_view(a: &View, b: &View) -> bool {
    let label = |c: &Corner| (c.row, c.col);
    let (mut count, mut sum_px2) = (0usize, 0.0);
    for corner in &a.corners {
        if let Ok(at) = b.corners.binary_search_by_key(&label(corner), label) {
            count += 1;
            sum_px2 += corner.pixel.distance_px(b.corners[at].pixel).powi(2);
        }
    }
    count > 0 && sum_px2 <= SAME_VIEW_PX.powi(2) * count as f64
}

/// Scatter across the best line through the points over the scatter along it, 0 to 1.
fn scatter_share(points: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let count = points.clone().count() as f64;
    let sum = points
        .clone()
        .fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
    let mean = (sum.0 / count, sum.1 / count);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in points {
        let (x, y) = (x - mean.0, y - mean.1);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    // Eigenvalues of the scatter matrix.
    let half_trace = f64::midpoint(xx, yy);
    let root = ((xx - yy) / 2.0).hypot(xy);
    if half_trace + root > 0.0 {
        ((half_trace - root).max(0.0) / (half_trace + root)).sqrt()
    } else {
        0.0
    }
}

fn check_connected(dataset: &Dataset, usable: &[Vec<View>]) -> Result<(), SufficiencyError> {
    let poses: Vec<_> = usable.iter().map(|views| poses(views)).collect();
    let mut reached = vec![false; poses.len()];
    let mut open = vec![0];
    while let Some(camera_idx) = open.pop() {
        if std::mem::replace(&mut reached[camera_idx], true) {
            continue;
        }
        let sees_known = |k: usize| poses[k].iter().any(|p| dataset.known_poses.contains_key(p));
        open.extend((0..poses.len()).filter(|k| {
            let shared = !poses[*k].is_disjoint(&poses[camera_idx]);
            !reached[*k] && (shared || (sees_known(*k) && sees_known(camera_idx)))
        }));
    }
    match reached.iter().position(|r| !r) {
        None => Ok(()),
        Some(camera_idx) => Err(SufficiencyError::NotConnected {
            camera: dataset.cameras[camera_idx].name.clone(),
            reference: dataset.cameras[0].name.clone(),
        }),
    }
}

#[cfg(test)]
mod tests;
