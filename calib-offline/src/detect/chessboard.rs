//! The chessboard detector behind our own trait: an image in, a grid of rough corners out.
//!
//! The detector crate finds corners and numbers them as a grid, from an origin of its own. What
//! the numbers mean on the board, and where exactly the corners are, is settled by us (see
//! [`super::labelling`] and [`super::corner_fit`]).

use crate::board::BoardSpec;
use crate::dataset::image::GrayImage;
use crate::geometry::PixelPoint;
use calib_targets::chessboard::{
    ChessboardDetector as TopologicalGrid, ChessboardParams, GrayImageView, default_chess_config,
    detect_corners,
};
use chess_corners::ImageRefiner;

/// A corner as the detector numbered it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawCorner {
    /// Number along one direction of the board.
    pub i: i32,
    /// Number along the other.
    pub j: i32,
    /// Roughly where it is.
    pub pixel: PixelPoint,
}

/// Finds the corners of a chessboard in an image.
pub trait ChessboardDetector: Sync {
    /// The corners of the largest connected grid, numbered from any origin and in any
    /// orientation, mirrored included; empty if there is none.
    ///
    /// The grid may be a part of the board, and may have stray corners beside it.
    fn detect(&self, image: &GrayImage, board: &BoardSpec) -> Vec<RawCorner>;
}

/// `ChESS` corners with a saddle-point refinement, joined to a grid by their triangulation.
///
/// The image is stretched to full contrast first, so that exposure does not matter, and tried at
/// full, half and quarter size until the whole board is found: large blurred squares show their
/// corners only in the small image.
#[derive(Debug, Clone, Copy, Default)]
pub struct ChessTopologicalDetector;

/// Sizes tried: full, half, quarter.
const LEVELS: usize = 3;
/// Fractions of the pixels that are allowed to saturate when the image is stretched.
const STRETCH_QUANTILES: [f64; 2] = [0.005, 0.995];

impl ChessboardDetector for ChessTopologicalDetector {
    fn detect(&self, image: &GrayImage, board: &BoardSpec) -> Vec<RawCorner> {
        let mut best: Vec<RawCorner> = Vec::new();
        let mut smaller: Option<GrayImage> = None;
        for level in 0..LEVELS {
            let at_level = smaller.as_ref().unwrap_or(image);
            let found = detect_at_level(at_level, level);
            // A corner more or less at a smaller size is no reason to give up the sharper one.
            if found.len() > best.len() + best.len() / 10 {
                best = found;
            }
            if best.len() >= board.corner_count() {
                break;
            }
            let next = at_level.halved();
            if next.is_none() {
                break;
            }
            smaller = next;
        }
        best
    }
}

fn detect_at_level(image: &GrayImage, level: usize) -> Vec<RawCorner> {
    let [black, white] = image.quantiles(STRETCH_QUANTILES);
    let stretched = image.stretched(black, white);
    let view = GrayImageView {
        width: image.sensor.width as usize,
        height: image.sensor.height as usize,
        data: &stretched,
    };
    let config = default_chess_config().with_refiner(ImageRefiner::saddle_point());
    let corners = detect_corners(&view, &config);
    let Ok(grid) = TopologicalGrid::new(ChessboardParams::default()) else {
        return Vec::new();
    };
    let scale = f64::from(1u32 << level);
    let full_size = |x: f32| f64::from(x) * scale + (scale - 1.0) / 2.0;
    let largest = grid.detect(&corners);
    let corners = largest.map(|found| found.corners).unwrap_or_default();
    corners
        .iter()
        .map(|corner| RawCorner {
            i: corner.grid.u,
            j: corner.grid.v,
            pixel: PixelPoint::new(full_size(corner.position.x), full_size(corner.position.y)),
        })
        .collect()
}
