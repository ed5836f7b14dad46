//! From images to labelled corners.
//!
//! Per image: rough grid of corners ([`chessboard`]), sub-pixel fit and completion ([`grid`],
//! [`corner_fit`]), possible places on the board ([`labelling`], [`border`]). Over all images:
//! the same label for the same corner ([`consistency`], [`epipolar`]). Every image gets a verdict
//! ([`verdict`]).
//!
//! Labels are right-handed in the image: x along the columns and y along the rows turn as u and v
//! do, as on a board seen directly from its printed side. A camera that looks into a mirror cannot
//! be told from the image of a flat board; that no mirror is there is assumed.

pub mod border;
pub mod chessboard;
pub mod consistency;
pub mod corner_fit;
mod edge_fit;
pub mod epipolar;
pub mod grid;
pub mod labelling;
pub mod overlay;
pub mod ring_target;
pub mod suspicion;
pub mod verdict;

#[cfg(test)]
mod tests;

use crate::dataset::Dataset;
use crate::dataset::image::{GrayImage, ImageError};
use border::Borders;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::observed::{Corner, View};
use calib_rays::progress::Progress;
use chessboard::{ChessTopologicalDetector, ChessboardDetector};
use consistency::{ConsistencyError, UnsettledView};
use epipolar::{FundamentalMatrix, Match};
use grid::FittedGrid;
use labelling::{Placement, placements};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use verdict::{ImageFigures, ImageVerdict, Outcome, Refusal, why_not_placed, why_nothing_found};

/// Choices in the detection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectSettings {
    /// Half the largest window over which a corner's edges are taken as straight, px. Smaller
    /// squares have a window of half a square to each side.
    pub max_half_window_px: f64,
    /// Added in quadrature to the standard deviation that each fit predicts from its own residuals,
    /// for what all models of an edge leave out, px.
    pub sigma_floor_px: f64,
}

impl Default for DetectSettings {
    /// 20 px: on the `opencv-stereo` images (squares of 25 to 45 px) the held-out error of
    /// neighboring corners is 0.46 % of the square with 6 px, 0.44 % with 8 px, 0.41 % with 12 px
    /// and 0.40 % from 16 px on. The floor is the scatter that remains on rendered images
    /// whatever the noise: 0.005 px in perspective views, up to 0.02 px through a fisheye.
    fn default() -> Self {
        Self {
            max_half_window_px: 20.0,
            sigma_floor_px: 0.02,
        }
    }
}

/// What was found in a dataset's images.
#[derive(Debug)]
pub struct Detection {
    /// The labelled corners, by camera and pose.
    pub views: Vec<View>,
    /// One verdict per image that was looked at, by camera and pose.
    pub images: Vec<ImageVerdict>,
    /// Images in which the board is turned against the way it has in most.
    pub turned: Vec<TurnedImage>,
    /// Whether the cameras' corners belong together, for each camera after the first.
    pub pair_checks: Vec<PairCheck>,
}

/// An image in which the board is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TurnedImage {
    /// Index into the dataset's cameras.
    pub camera_idx: usize,
    /// Number of the pose.
    pub pose: usize,
    /// Quarter turns, clockwise on screen, against the majority of the images: 1 to 3.
    pub quarter_turns: u8,
}

/// How well the corners of a camera and of the first one agree on a common epipolar geometry.
///
/// Lens distortion leaves a few pixels in wide lenses. A pose that stands out was not exposed at
/// the same instant, or is mislabelled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairCheck {
    /// The camera compared with camera 0.
    pub camera_idx: usize,
    /// Poses seen by both.
    pub pose_count: usize,
    /// Median distance from the epipolar line, px.
    pub median_px: f64,
    /// The pose with the largest median of its own.
    pub worst_pose: usize,
    /// That median, px.
    pub worst_px: f64,
}

/// Why a dataset's images could not be searched as a whole.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// There is nothing to look at.
    #[error(
        "the dataset names no images: give every [[camera]] of dataset.toml the key images or \
         image_list, or corners.csv"
    )]
    NoImages,
    /// A file that should be an image of this camera and is not: damaged, or of another size.
    /// An image that merely shows no board is refused and no error.
    #[error(
        "the image of camera {camera}, pose {pose}, cannot be used{}",
        if *more == 0 { String::new() } else { format!(", and {more} more images cannot either") }
    )]
    BrokenImage {
        /// Name of the camera.
        camera: String,
        /// Number of the pose.
        pose: usize,
        /// Other images that cannot be used.
        more: usize,
        /// What is wrong with the first.
        source: Box<ImageError>,
    },
    /// The images cannot be numbered alike.
    #[error(transparent)]
    Consistency(#[from] ConsistencyError),
}

/// An image to look at.
struct Job<'a> {
    camera_idx: usize,
    pose: usize,
    path: &'a PathBuf,
    sensor: SensorSize,
}

/// What one image shows by itself.
struct Inspected {
    grid: FittedGrid,
    placements: Vec<Placement>,
    figures: Option<ImageFigures>,
}

/// Finds the board in every image of the dataset that is not excluded and labels its corners.
///
/// Images are searched in parallel; the result does not depend on the number of threads. Images
/// without a usable board are refused one by one with a reason and are no error, all of them
/// included.
///
/// # Errors
/// [`DetectError`] if there are no images, if a file is no image of its camera, or if the board looks the same after a turn and nothing
/// tells its turn between poses or cameras.
pub fn detect_dataset(
    dataset: &Dataset,
    settings: &DetectSettings,
    progress: &dyn Progress,
) -> Result<Detection, DetectError> {
    detect_dataset_with(&ChessTopologicalDetector, dataset, settings, progress)
}

/// As [`detect_dataset`], with another detector.
///
/// # Errors
/// As [`detect_dataset`].
pub fn detect_dataset_with(
    detector: &dyn ChessboardDetector,
    dataset: &Dataset,
    settings: &DetectSettings,
    progress: &dyn Progress,
) -> Result<Detection, DetectError> {
    let jobs = jobs(dataset);
    if jobs.is_empty() {
        return Err(DetectError::NoImages);
    }
    progress.begin("detecting corners", jobs.len());
    let loaded: Vec<Result<Result<Inspected, Refusal>, ImageError>> = jobs
        .par_iter()
        .map(|job| {
            let result = GrayImage::load_sized(job.path, job.sensor)
                .map(|image| inspect(detector, &image, &dataset.board, settings));
            progress.advance();
            result
        })
        .collect();
    progress.end();
    let inspected = all_loaded(dataset, &jobs, loaded)?;

    let mut figures = Vec::new();
    let mut refusals: Vec<Option<Refusal>> = Vec::new();
    let mut unsettled = Vec::new();
    for (job, result) in jobs.iter().zip(inspected) {
        match result {
            Ok(found) => {
                figures.push(found.figures);
                refusals.push(None);
                unsettled.push(UnsettledView {
                    camera_idx: job.camera_idx,
                    pose: job.pose,
                    grid: found.grid,
                    placements: found.placements,
                });
            }
            Err(refusal) => {
                figures.push(None);
                refusals.push(Some(refusal));
            }
        }
    }
    let names: Vec<&str> = dataset.cameras.iter().map(|c| c.name.as_str()).collect();
    let settled = consistency::settle(&dataset.board, dataset.stage.as_ref(), &names, unsettled)?;

    let mut views = Vec::new();
    let mut images = Vec::new();
    let mut settled = settled.into_iter();
    for ((job, refusal), figures) in jobs.iter().zip(refusals).zip(figures) {
        let outcome = match refusal {
            Some(refusal) => Outcome::Refused(refusal),
            None => match settled.next() {
                Some((view, Some(placement))) => {
                    views.push(labelled_view(&view, &placement, settings));
                    used(&view, &placement, &dataset.board)
                }
                Some((view, None)) => Outcome::Refused(not_settled(&view)),
                None => Outcome::Refused(Refusal::NoBoard),
            },
        };
        images.push(ImageVerdict {
            camera_idx: job.camera_idx,
            pose: job.pose,
            path: job.path.clone(),
            outcome,
            figures,
        });
    }
    Ok(Detection {
        turned: turned_images(&images),
        pair_checks: pair_checks(&views),
        views,
        images,
    })
}

/// What the images show, if every file could be loaded.
fn all_loaded<T>(
    dataset: &Dataset,
    jobs: &[Job<'_>],
    loaded: Vec<Result<T, ImageError>>,
) -> Result<Vec<T>, DetectError> {
    let broken = loaded.iter().filter(|image| image.is_err()).count();
    jobs.iter()
        .zip(loaded)
        .map(|(job, image)| {
            image.map_err(|source| DetectError::BrokenImage {
                camera: dataset.cameras[job.camera_idx].name.clone(),
                pose: job.pose,
                more: broken - 1,
                source: Box::new(source),
            })
        })
        .collect()
}

/// The images to look at, by camera and pose.
fn jobs(dataset: &Dataset) -> Vec<Job<'_>> {
    let mut jobs = Vec::new();
    for (camera_idx, camera) in dataset.cameras.iter().enumerate() {
        for (pose, path) in camera.images.iter().enumerate() {
            if let (Some(path), false) = (path, dataset.excluded_poses.contains(&pose)) {
                jobs.push(Job {
                    camera_idx,
                    pose,
                    path,
                    sensor: camera.sensor,
                });
            }
        }
    }
    jobs
}

/// What one image shows by itself: the corners, and where on the board they can be.
fn inspect(
    detector: &dyn ChessboardDetector,
    image: &GrayImage,
    board: &BoardSpec,
    settings: &DetectSettings,
) -> Result<Inspected, Refusal> {
    let raw = detector.detect(image, board);
    let grid = FittedGrid::from_raw(image, &raw, board, settings.max_half_window_px)
        .ok_or_else(|| why_nothing_found(image))?;
    if let (Some(typical), Some(square_px)) = (grid.typical(), grid.square_px())
        && typical.blur_px > verdict::MAX_BLUR_SQUARES * square_px
    {
        return Err(Refusal::too_blurred(typical.blur_px));
    }
    let borders = if grid.is_whole(board) {
        Borders::UNKNOWN
    } else {
        Borders::seen(image, &grid)
    };
    let placements = placements(&grid, board, &borders);
    if placements.is_empty() {
        return Err(why_not_placed(&grid, board));
    }
    Ok(Inspected {
        figures: ImageFigures::of(image, &grid),
        grid,
        placements,
    })
}

/// The labelled corners of a settled view, by row and column.
fn labelled_view(view: &UnsettledView, placement: &Placement, settings: &DetectSettings) -> View {
    let mut corners: Vec<Corner> = view
        .grid
        .corners
        .iter()
        .map(|(&node, corner)| {
            let (row, col) = placement.row_col(node);
            Corner {
                row,
                col,
                pixel: corner.pixel,
                sigma_px: Some(corner.sigma_px.hypot(settings.sigma_floor_px)),
            }
        })
        .collect();
    corners.sort_unstable_by_key(|c| (c.row, c.col));
    View {
        camera_idx: view.camera_idx,
        pose: view.pose,
        corners,
    }
}

fn used(view: &UnsettledView, placement: &Placement, board: &BoardSpec) -> Outcome {
    let angle_rad = consistency::x_angle_rad(&view.grid, placement);
    let quarter_turns = (angle_rad / std::f64::consts::FRAC_PI_2).round() as i32;
    let corner_count = view.grid.corners.len();
    Outcome::Used {
        corner_count,
        partial: corner_count < board.corner_count(),
        quarter_turns: quarter_turns.rem_euclid(4) as u8,
    }
}

fn not_settled(view: &UnsettledView) -> Refusal {
    if view.placements.is_empty() {
        return Refusal::WrongColors;
    }
    let (i, j) = view.grid.size();
    Refusal::AmbiguousPlacement {
        found_rows: j,
        found_cols: i,
        placement_count: view.placements.len(),
    }
}

/// The images turned against the majority. Of equally common turns, the smallest counts as the
/// majority's.
fn turned_images(images: &[ImageVerdict]) -> Vec<TurnedImage> {
    let turns = |image: &ImageVerdict| match image.outcome {
        Outcome::Used { quarter_turns, .. } => Some(quarter_turns),
        Outcome::Refused(_) => None,
    };
    let count = |turn: u8| images.iter().filter(|i| turns(i) == Some(turn)).count();
    let usual = (0..4u8).rev().max_by_key(|&turn| count(turn)).unwrap_or(0);
    images
        .iter()
        .filter_map(|image| {
            let turned = (turns(image)? + 4 - usual) % 4;
            (turned > 0).then_some(TurnedImage {
                camera_idx: image.camera_idx,
                pose: image.pose,
                quarter_turns: turned,
            })
        })
        .collect()
}

/// Compares every camera with the first.
fn pair_checks(views: &[View]) -> Vec<PairCheck> {
    let last = views.iter().map(|v| v.camera_idx).max().unwrap_or(0);
    (1..=last)
        .filter_map(|camera_idx| pair_check(views, camera_idx))
        .collect()
}

fn pair_check(views: &[View], camera_idx: usize) -> Option<PairCheck> {
    let mut by_pose: BTreeMap<usize, Vec<Match>> = BTreeMap::new();
    for second in views.iter().filter(|v| v.camera_idx == camera_idx) {
        let first = views
            .iter()
            .find(|v| v.camera_idx == 0 && v.pose == second.pose);
        let matches = first.map(|first| matches_of(first, second));
        if let Some(matches) = matches.filter(|m| !m.is_empty()) {
            by_pose.insert(second.pose, matches);
        }
    }
    let all: Vec<Match> = by_pose.values().flatten().copied().collect();
    let fundamental = FundamentalMatrix::from_matches(&all)?;
    let (worst_pose, worst_px) = by_pose
        .iter()
        .filter_map(|(&pose, matches)| Some((pose, fundamental.median_distance_px(matches)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(PairCheck {
        camera_idx,
        pose_count: by_pose.len(),
        median_px: fundamental.median_distance_px(&all)?,
        worst_pose,
        worst_px,
    })
}

fn matches_of(first: &View, second: &View) -> Vec<Match> {
    let by_label: BTreeMap<(usize, usize), PixelPoint> = first
        .corners
        .iter()
        .map(|c| ((c.row, c.col), c.pixel))
        .collect();
    second
        .corners
        .iter()
        .filter_map(|c| Some((*by_label.get(&(c.row, c.col))?, c.pixel)))
        .collect()
}
