//! The chessboard detector behind our own trait: an image in, a grid of rough corners out.
//!
//! The detector crate finds corners and numbers them as a grid, from an origin of its own. What
//! the numbers mean on the board, and where exactly the corners are, is settled by us (see
//! [`super::labelling`] and [`super::corner_fit`]).

use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use calib_targets_chessboard::{
    ChessCorner, ChessboardDetector as TopologicalGrid, ChessboardParams, GrayImageView,
    default_chess_config, detect_corners,
};
use chess_corners::ImageRefiner;
use std::collections::BTreeMap;

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
    /// The corners of every connected grid, largest first, each numbered from any origin and in any
    /// orientation, mirrored included; empty if there is none.
    ///
    /// A grid may be a part of the board, may have stray corners beside it, and may be another board.
    fn detect(&self, image: &GrayImage, board: &BoardSpec) -> Vec<Vec<RawCorner>>;
}

/// `ChESS` corners with a saddle-point refinement, joined to a grid by their triangulation.
///
/// The image is stretched to full contrast first, so that exposure does not matter. It is searched at
/// full, half and quarter size until the whole board is found: large blurred squares show their corners
/// only in the small image. A large image is searched reduced first, where most boards are found whole
/// for a fraction of the time. If most of the board is still missing, double size is tried: the detector
/// needs squares of about eight pixels.
#[derive(Debug, Clone, Copy, Default)]
pub struct ChessTopologicalDetector;

/// Images with more pixels than this are searched at half size first, with sixteen times more at a
/// quarter.
const LARGE_PIXELS: usize = 600_000;
/// Pixels that are searched at once.
const STRIP_PIXELS: usize = 2_000_000;
/// Rows beyond a strip that the search of a corner in it looks at, and more.
const STRIP_MARGIN_PX: usize = 32;
/// Fractions of the pixels that are allowed to saturate when the image is stretched.
const STRETCH_QUANTILES: [f64; 2] = [0.005, 0.995];

impl ChessboardDetector for ChessTopologicalDetector {
    fn detect(&self, image: &GrayImage, board: &BoardSpec) -> Vec<Vec<RawCorner>> {
        let pixels = image.values().len();
        let order = if pixels > 16 * LARGE_PIXELS {
            [Size::Quarter, Size::Half, Size::Full]
        } else if pixels > LARGE_PIXELS {
            [Size::Half, Size::Full, Size::Quarter]
        } else {
            [Size::Full, Size::Half, Size::Quarter]
        };
        let mut found = BTreeMap::new();
        for size in order {
            let grids = parts_at(image, size);
            if grids.iter().any(|grid| is_whole(grid, board)) {
                return grids;
            }
            found.insert(size, grids);
        }
        // Larger sizes first.
        let mut best = Vec::new();
        for grids in found.into_values() {
            take_larger(&mut best, grids, board);
        }
        // Squares of less than eight pixels in an image that large are a thousandth of its width.
        if pixels <= 16 * LARGE_PIXELS && 2 * largest(&best, board) < board.corner_count() {
            take_larger(&mut best, parts_at(image, Size::Double), board);
        }
        best
    }
}

/// Whether a grid has the board's extent and all of its corners.
fn is_whole(grid: &[RawCorner], board: &BoardSpec) -> bool {
    let extent = |of: fn(&RawCorner) -> i32| {
        let (low, high) = grid
            .iter()
            .map(of)
            .fold((i32::MAX, i32::MIN), |(low, high), k| {
                (low.min(k), high.max(k))
            });
        (i64::from(high) - i64::from(low) + 1) as usize
    };
    if grid.len() != board.corner_count() {
        return false;
    }
    let (i, j) = (extent(|corner| corner.i), extent(|corner| corner.j));
    (i, j) == (board.cols, board.rows) || (i, j) == (board.rows, board.cols)
}

/// Corners of the grid that says most of the board: a whole one more than any.
fn largest(grids: &[Vec<RawCorner>], board: &BoardSpec) -> usize {
    let count = |grid: &Vec<RawCorner>| {
        if is_whole(grid, board) {
            usize::MAX / 2
        } else {
            grid.len()
        }
    };
    grids.iter().map(count).max().unwrap_or(0)
}

/// A corner more or less at another size is no reason to give up the sharper ones.
fn take_larger(best: &mut Vec<Vec<RawCorner>>, found: Vec<Vec<RawCorner>>, board: &BoardSpec) {
    let count = largest(best, board);
    if largest(&found, board) > count + count / 10 {
        *best = found;
    }
}

/// Pixels of the original per pixel of a resized image.
#[derive(Debug, Clone, Copy)]
struct Scale(f64);

impl Scale {
    const FULL: Self = Self(1.0);
    const HALF: Self = Self(2.0);
    const QUARTER: Self = Self(4.0);
    const DOUBLE: Self = Self(0.5);

    /// In the original; pixels are areas whose outer edges coincide.
    fn original(self, x: f32) -> f64 {
        (f64::from(x) + 0.5) * self.0 - 0.5
    }
}

/// A size at which an image is searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Size {
    /// As it is.
    Full,
    /// Half.
    Half,
    /// A quarter.
    Quarter,
    /// Double.
    Double,
}

/// The sizes in the order in which they are tried.
pub const SIZES: [Size; 4] = [Size::Full, Size::Half, Size::Quarter, Size::Double];

impl Size {
    /// Whether the image is searched larger than it is.
    pub fn is_enlarged(self) -> bool {
        self == Self::Double
    }
}

/// The corners of every connected grid in an image searched at a size, each numbered from an origin of
/// its own, the largest first.
pub fn parts_at(image: &GrayImage, size: Size) -> Vec<Vec<RawCorner>> {
    let at = |resized: Option<GrayImage>, scale: Scale| {
        resized.map_or_else(Vec::new, |resized| detect_at(&resized, scale))
    };
    match size {
        Size::Full => detect_at(image, Scale::FULL),
        Size::Half => at(image.halved(), Scale::HALF),
        Size::Quarter => at(
            image.halved().and_then(|half| half.halved()),
            Scale::QUARTER,
        ),
        Size::Double => at(image.doubled(), Scale::DOUBLE),
    }
}

fn detect_at(image: &GrayImage, scale: Scale) -> Vec<Vec<RawCorner>> {
    let corners = corners_in_strips(image, STRIP_PIXELS);
    let Ok(grid) = TopologicalGrid::new(ChessboardParams::default()) else {
        return Vec::new();
    };
    let mut grids: Vec<Vec<RawCorner>> = grid
        .detect_all(&corners)
        .iter()
        .map(|found| {
            let raw = found.corners.iter().map(|corner| RawCorner {
                i: corner.grid.u,
                j: corner.grid.v,
                pixel: PixelPoint::new(
                    scale.original(corner.position.x),
                    scale.original(corner.position.y),
                ),
            });
            raw.collect()
        })
        .collect();
    grids.sort_by_key(|grid| std::cmp::Reverse(grid.len()));
    grids
}

/// The corners of an image, searched strip by strip: what the search keeps per pixel is several times the image, and
/// is kept of one strip at a time. A corner counts in the strip that it lies in; each is seen with all that its search
/// looks at.
fn corners_in_strips(image: &GrayImage, strip_pixels: usize) -> Vec<ChessCorner> {
    let [black, white] = image.quantiles(STRETCH_QUANTILES);
    let (width, height) = (image.sensor.width as usize, image.sensor.height as usize);
    // What is weaker is left out of every grid, and need not be looked at closely.
    let config = default_chess_config()
        .with_refiner(ImageRefiner::saddle_point())
        .with_threshold(ChessboardParams::default().min_corner_strength);
    let strips = (width * height).div_ceil(strip_pixels).max(1);
    let first_row = |strip: usize| strip * height / strips;
    let mut corners = Vec::new();
    for strip in 0..strips {
        let own = first_row(strip)..first_row(strip + 1);
        let from = own.start.saturating_sub(STRIP_MARGIN_PX);
        let to = (own.end + STRIP_MARGIN_PX).min(height);
        let view = GrayImageView {
            width,
            height: to - from,
            data: &image.stretched_rows(black, white, from..to),
        };
        // Places below the last row's middle belong to it.
        let (upper, lower) = (own.start as f32 - 0.5, own.end as f32 - 0.5);
        corners.extend(
            detect_corners(&view, &config)
                .into_iter()
                .map(|mut corner| {
                    corner.position.y += from as f32;
                    corner
                })
                .filter(|corner| {
                    (strip == 0 || corner.position.y >= upper)
                        && (strip + 1 == strips || corner.position.y < lower)
                }),
        );
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::SensorSize;

    #[test]
    fn strips_find_the_corners_of_the_whole_image() {
        // Squares of 11 px, turned a little: corners lie on every border between strips.
        let (width, height) = (400, 300);
        let values = (0..width * height).map(|k| {
            let (u, v) = (f64::from(k % width), f64::from(k / width));
            let (x, y) = ((u + 0.2 * v) / 11.0, (v - 0.2 * u) / 11.0);
            let wave = (std::f64::consts::PI * x).sin() * (std::f64::consts::PI * y).sin();
            (128.0 + 120.0 * (8.0 * wave).tanh()) as f32
        });
        let sensor = SensorSize::new(width, height);
        let image = GrayImage::from_values(sensor, values.collect(), 255.0).unwrap();
        let whole = corners_in_strips(&image, usize::MAX);
        let strips = corners_in_strips(&image, 20_000);
        assert!(whole.len() > 800, "{}", whole.len());
        assert_eq!(whole.len(), strips.len());
        for (a, b) in whole.iter().zip(&strips) {
            assert!((a.position - b.position).norm() < 1e-3);
            assert_eq!(a.strength, b.strength);
        }
    }
}
