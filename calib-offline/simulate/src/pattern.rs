//! What is printed on a flat plate: a chessboard, a target of ring markers, or any artwork.
//!
//! A pattern is black (0) or white (1) at every point of its plane, mm, in the frame of its plate:
//! origin at the first corner or marker, x along the columns, y along the rows, z away from the
//! printed face. The plate ends where the white margin does; beyond it is background.

use calib_rays::board::BoardSpec;
use calib_rays::print::Artwork;
use std::sync::Arc;

/// A printed plate.
#[derive(Debug, Clone, PartialEq)]
pub enum Pattern {
    /// The calibration board: squares one ring beyond the inner corners, white margin around.
    Chessboard(BoardSpec),
    /// The measurement target.
    RingTarget,
    /// Any other print.
    Printed(Arc<Artwork>),
}

/// Marker rows and columns of the ring target: 63 markers.
pub const RING_ROWS: usize = 7;
/// See [`RING_ROWS`].
pub const RING_COLS: usize = 9;
/// Distance of neighboring markers, mm.
pub const RING_PITCH_MM: f64 = 12.0;
/// Outer and inner radius of an ordinary marker (a black ring on white), mm.
pub const RING_RADII_MM: (f64, f64) = (4.0, 2.0);
/// The same for a direction marker.
pub const DIRECTION_RADII_MM: (f64, f64) = (5.0, 2.5);
/// (row, col) of the direction markers. The middle one, two to its right, one below it, and one at
/// the upper left: no turn and no mirror maps the five onto themselves.
pub const DIRECTION_MARKERS: [(usize, usize); 5] = [(3, 4), (3, 5), (3, 6), (4, 4), (1, 2)];
/// White margin of the ring target around its outer marker centers, mm.
const RING_MARGIN_MM: f64 = 14.0;

/// Whether a marker of the ring target is one of the larger ones.
pub fn is_direction_marker(row: usize, col: usize) -> bool {
    DIRECTION_MARKERS.contains(&(row, col))
}

/// What a point of the plane shows, and what lies beyond the nearest edge.
///
/// 0 is black, 1 white; `None` is beyond the plate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shade {
    /// Here.
    pub ink: Option<f32>,
    /// Across the nearest edge; may be the same where there is none worth the name.
    pub beyond: Option<f32>,
    /// Distance of that edge, mm: no other is nearer.
    pub edge_mm: f64,
}

impl Pattern {
    /// The plate's borders (x from, x to, y from, y to), mm.
    pub(super) fn plate_mm(&self) -> [f64; 4] {
        match self {
            Self::Chessboard(board) => {
                let (width_mm, height_mm) = board.extent_mm();
                let beyond = 2.0 * board.square_mm;
                [-beyond, width_mm + beyond, -beyond, height_mm + beyond]
            }
            Self::RingTarget => [
                -RING_MARGIN_MM,
                (RING_COLS - 1) as f64 * RING_PITCH_MM + RING_MARGIN_MM,
                -RING_MARGIN_MM,
                (RING_ROWS - 1) as f64 * RING_PITCH_MM + RING_MARGIN_MM,
            ],
            Self::Printed(art) => art.plate_mm,
        }
    }

    pub(super) fn shade(&self, x: f64, y: f64) -> Shade {
        let [left, right, top, bottom] = self.plate_mm();
        // Positive inside the plate.
        let inside = (x - left).min(right - x).min(y - top).min(bottom - y);
        if inside < 0.0 {
            return Shade {
                ink: None,
                beyond: Some(1.0),
                edge_mm: -inside,
            };
        }
        let print = match self {
            Self::Chessboard(board) => chess(board, x, y),
            Self::RingTarget => ring(x, y),
            Self::Printed(art) => {
                let shade = art.shade(x, y);
                Shade {
                    ink: Some(ink(shade.black)),
                    beyond: Some(ink(shade.black_beyond)),
                    edge_mm: shade.edge_mm,
                }
            }
        };
        if print.edge_mm < inside {
            print
        } else {
            Shade {
                beyond: None,
                edge_mm: inside,
                ..print
            }
        }
    }
}

fn ink(is_black: bool) -> f32 {
    if is_black { 0.0 } else { 1.0 }
}

fn chess(board: &BoardSpec, x: f64, y: f64) -> Shade {
    let s = board.square_mm;
    let is_black = |x: f64, y: f64| {
        let square = (x / s).floor() as i64 + (y / s).floor() as i64;
        square.rem_euclid(2) == 0
    };
    let (width_mm, height_mm) = board.extent_mm();
    let inside = (x + s)
        .min(width_mm + s - x)
        .min(y + s)
        .min(height_mm + s - y);
    if inside < 0.0 {
        // On the white margin; a border square lies across the edge.
        let within = |value: f64, extent: f64| value.clamp(-s * 0.999, extent + s * 0.999);
        let across = is_black(within(x, width_mm), within(y, height_mm));
        return Shade {
            ink: Some(ink(false)),
            beyond: Some(ink(across)),
            edge_mm: -inside,
        };
    }
    let to_line = |value: f64| (value - (value / s).round() * s).abs();
    let edge_mm = to_line(x).min(to_line(y));
    let here = is_black(x, y);
    // Beyond the outer squares everything is white, beside any other square is its opposite.
    let beyond = inside > edge_mm && !here;
    Shade {
        ink: Some(ink(here)),
        beyond: Some(ink(beyond)),
        edge_mm,
    }
}

fn ring(x: f64, y: f64) -> Shade {
    let nearest = |value: f64, count: usize| {
        (value / RING_PITCH_MM)
            .round()
            .clamp(0.0, (count - 1) as f64)
    };
    let (col, row) = (nearest(x, RING_COLS), nearest(y, RING_ROWS));
    let (outer, inner) = if is_direction_marker(row as usize, col as usize) {
        DIRECTION_RADII_MM
    } else {
        RING_RADII_MM
    };
    let radius = (x - col * RING_PITCH_MM).hypot(y - row * RING_PITCH_MM);
    let edge = (radius - outer).abs().min((radius - inner).abs());
    // Another marker's center is no nearer than this one's, and no nearer than the pitch leaves.
    let to_other = (RING_PITCH_MM - radius).max(radius) - DIRECTION_RADII_MM.0;
    let here = (inner..outer).contains(&radius);
    Shade {
        ink: Some(ink(here)),
        beyond: Some(ink(if edge <= to_other { !here } else { here })),
        edge_mm: edge.min(to_other),
    }
}
