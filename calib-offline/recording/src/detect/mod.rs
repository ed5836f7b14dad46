//! From images to labelled corners.
//!
//! Per image: rough grid of corners ([`chessboard`]), sub-pixel fit and completion (`grid_fit.rs`,
//! [`corner_fit`]), their scatter, possible places on the board ([`labelling`], [`border`]). Over all images:
//! the same label for the same corner ([`consistency`], [`epipolar`]). Every image gets a verdict
//! ([`verdict`]).
//!
//! Labels are right-handed in the image: x along the columns and y along the rows turn as u and v
//! do, as on a board seen directly from its printed side. A camera that looks into a mirror cannot
//! be told from the image of a flat board; that no mirror is there is assumed.

pub mod border;
pub mod chessboard;
mod completion;
pub mod consistency;
pub mod corner_fit;
mod corner_window;
mod detection;
mod edge_fit;
mod edge_model;
pub mod epipolar;
mod error;
pub mod grid;
mod grid_fit;
pub mod grid_size;
pub mod homography;
pub mod illegible;
mod job;
pub mod labelling;
mod lattice;
pub mod marked;
pub mod overlay;
mod pair_check;
mod pixel_edge;
pub mod printed;
pub mod ring_target;
mod scatter;
mod seen_board;
mod settings;
pub mod turning;
pub mod verdict;
mod wrong_count;

pub use detection::{Detection, TurnedImage};
pub use error::{DetectError, OddImage};
pub use pair_check::PairCheck;
pub use seen_board::{SeenBoard, SeenKind};
pub use settings::DetectSettings;

use crate::dataset::image::{GrayImage, ImageError, bayer};
use crate::dataset::{BoardKind, Dataset};
use border::Borders;
use calib_rays::board::BoardSpec;
use calib_rays::observed::{Corner, View};
use calib_rays::progress::Progress;
use chessboard::{ChessTopologicalDetector, ChessboardDetector, RawCorner};
use consistency::UnsettledView;
use grid::FittedGrid;
use illegible::{Illegible, Shown};
use job::{Job, all_loaded, check_sizes};
use labelling::{Placement, placements};
use printed::charuco_parts::Part;
use printed::instead::{self, Stated, corners};
use rayon::prelude::*;
use verdict::{
    ImageFigures, ImageVerdict, MissingCorner, Outcome, Refusal, why_not_placed, why_nothing_found,
};

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
    check_sizes(dataset, &jobs)?;
    if let Some(target) = printed::of_kind(&dataset.kind) {
        return printed::detect(target, dataset, &jobs, settings, progress);
    }
    progress.begin("detecting corners", jobs.len());
    let loaded: Vec<Result<Result<Inspected, Refusal>, ImageError>> = jobs
        .par_iter()
        .map(|job| {
            let result = GrayImage::load_sized(job.path, job.sensor)
                .map(|image| inspect(detector, &image, dataset, settings));
            progress.advance();
            result
        })
        .collect();
    progress.end();
    let mut inspected = all_loaded(dataset, &jobs, loaded)?;
    let others = inspected.iter().filter_map(|found| found.as_ref().err());
    let is_stated = |found: &&Inspected| found.grid.corners.len() == dataset.board.corner_count();
    let stated_count = inspected.iter().flatten().filter(is_stated).count();
    wrong_count::check(&dataset.board, others, stated_count, inspected.len())?;
    for camera_idx in 0..dataset.cameras.len() {
        let of_camera = jobs.iter().zip(&mut inspected);
        let of_camera = of_camera.filter(|(job, _)| job.camera_idx == camera_idx);
        let mut found: Vec<&mut Inspected> = of_camera
            .filter_map(|(_, found)| found.as_mut().ok())
            .collect();
        scatter::pool(found.iter_mut().map(|found| &mut found.grid.model_error_px));
        for Inspected { figures, grid, .. } in found {
            if let (Some(figures), Some(sigma_px)) =
                (figures, grid.typical_sigma_px(settings.sigma_floor_px))
            {
                figures.sigma_px = sigma_px;
            }
        }
    }

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
        let mut missing = Vec::new();
        let outcome = match refusal {
            Some(refusal) => Outcome::Refused(refusal),
            None => match settled.next() {
                Some((view, Some(placement))) => {
                    views.push(labelled_view(&view, &placement, settings));
                    missing = MissingCorner::of(&view.grid, &placement, &dataset.board, job.sensor);
                    used(&view, &placement, &dataset.board)
                }
                Some((view, None)) => Outcome::Refused(not_settled(&view, figures.as_ref())),
                None => Outcome::Refused(Refusal::NoBoard {
                    kind: dataset.kind.word(),
                }),
            },
        };
        images.push(ImageVerdict {
            camera_idx: job.camera_idx,
            pose: job.pose,
            path: job.path.clone(),
            outcome,
            figures,
            missing,
        });
    }
    Ok(Detection::of(views, images))
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

/// What one image shows by itself: the corners, and where on the board they can be. Of several grids the one that
/// can be placed with most corners; an image without any is looked at as a raw color mosaic.
fn inspect(
    detector: &dyn ChessboardDetector,
    image: &GrayImage,
    dataset: &Dataset,
    settings: &DetectSettings,
) -> Result<Inspected, Refusal> {
    let found = inspect_gray(detector, image, dataset, settings);
    match found {
        Err(_) => match bayer::balanced(image) {
            Some(balanced) => inspect_gray(detector, &balanced, dataset, settings),
            None => found,
        },
        found => found,
    }
}

fn inspect_gray(
    detector: &dyn ChessboardDetector,
    image: &GrayImage,
    dataset: &Dataset,
    settings: &DetectSettings,
) -> Result<Inspected, Refusal> {
    let board = &dataset.board;
    let grids = detector.detect(image, board);
    let mut best = Err(None);
    for raw in &grids {
        match (inspect_grid(image, raw, dataset, settings), &best) {
            (Ok(found), Ok(Inspected { grid, .. }))
                if found.grid.corners.len() <= grid.corners.len() => {}
            (Ok(found), _) => best = Ok(found),
            // Of the largest grid.
            (Err(refusal), Err(None)) => best = Err(Some(refusal)),
            (Err(_), _) => {}
        }
    }
    best.map_err(|refusal| {
        // Of another chessboard the refusal says more.
        let is_plain = dataset.kind == BoardKind::Chessboard;
        instead::other(image, &stated(dataset))
            .filter(|other| !(is_plain && other.is_of_plain_chessboard()) || refusal.is_none())
            .or(refusal)
            .unwrap_or_else(|| why_nothing_found(image, dataset.kind.word()))
    })
}

/// The description of a chessboard.
fn stated(dataset: &Dataset) -> Stated {
    let marked = match &dataset.kind {
        BoardKind::MarkedChessboard(marked) => &marked[..],
        _ => &[],
    };
    Stated::chessboard((dataset.board.rows, dataset.board.cols), marked)
}

/// Fewest squares with a dot that make another board of a chessboard without.
const MIN_DOTS: usize = 2;

/// The refusal of a grid whose cells are no squares, or have dots that are not stated, if another target
/// is what they are.
fn not_as_stated(image: &GrayImage, raw: &[RawCorner], dataset: &Dataset) -> Option<Refusal> {
    let part = Part::of(raw);
    let is_plain = dataset.kind == BoardKind::Chessboard;
    let has_dots = is_plain && marked::clear_dots(&marked::squares(image, raw)).len() >= MIN_DOTS;
    let is_checkered = corners::checkered(image, &part).is_none_or(|part| part >= CHECKERED);
    let refusal = (has_dots || !is_checkered).then(|| instead::other(image, &stated(dataset)));
    refusal.flatten()
}

/// Part of the cells that are squares of one color on any chessboard, with glare and hands before it.
const CHECKERED: f64 = 0.8;

/// What one grid of an image shows.
fn inspect_grid(
    image: &GrayImage,
    raw: &[RawCorner],
    dataset: &Dataset,
    settings: &DetectSettings,
) -> Result<Inspected, Refusal> {
    let board = &dataset.board;
    if let Some(refusal) = not_as_stated(image, raw, dataset) {
        return Err(refusal);
    }
    let marked = match &dataset.kind {
        BoardKind::MarkedChessboard(marked) => Some((marked, marked::squares(image, raw))),
        _ => None,
    };
    let without_dots = marked.as_ref().map(|(_, s)| marked::without_dots(image, s));
    let image = without_dots.as_ref().unwrap_or(image);
    let grid = FittedGrid::from_raw(image, raw, board, settings.max_half_window_px)
        .ok_or_else(|| why_nothing_found(image, dataset.kind.word()))?;
    let figures = ImageFigures::of(image, &grid);
    if let (Some(typical), Some(square_px)) = (grid.typical(), grid.square_px())
        && typical.blur_px > verdict::MAX_BLUR_SQUARES * square_px
    {
        return Err(Illegible::blurred(typical.blur_px, Shown::Board).into());
    }
    let is_whole = grid.is_whole(board);
    let borders = if is_whole {
        Borders::UNKNOWN
    } else {
        Borders::seen(image, &grid)
    };
    let mut placements = placements(&grid, board, &borders);
    if let (Some((marked, squares)), false) = (&marked, placements.is_empty()) {
        placements = marked::agreeing(placements, squares, marked);
        if placements.is_empty() {
            return Err(Refusal::OtherMarks {
                marked: marked::dots(squares),
                stated: marked.len(),
            });
        }
    }
    if placements.is_empty() {
        let refusal = why_not_placed(&grid, board, &Borders::seen(image, &grid));
        return match figures.and_then(|figures| figures.illegible()) {
            Some(illegible) if !refusal.is_of_a_whole_board() => Err(illegible.into()),
            _ => Err(refusal),
        };
    }
    Ok(Inspected {
        grid,
        placements,
        figures,
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
                sigma_px: Some(view.grid.sigma_px(corner, settings.sigma_floor_px)),
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

fn not_settled(view: &UnsettledView, figures: Option<&ImageFigures>) -> Refusal {
    if view.placements.is_empty() {
        return Refusal::WrongColors;
    }
    if let Some(illegible) = figures.and_then(ImageFigures::illegible) {
        return illegible.into();
    }
    let (i, j) = view.grid.size();
    Refusal::AmbiguousPlacement {
        found_rows: j,
        found_cols: i,
        placement_count: view.placements.len(),
    }
}

#[cfg(test)]
mod tests;
