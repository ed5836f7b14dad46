//! A description, as what it would look like in an image.

use crate::dataset::TargetSpec;
use crate::detect::seen_board::{SeenBoard, SeenKind};
use calib_rays::print::{AprilGrid, Charuco, Circles};

/// What the description says.
#[derive(Debug, Clone)]
pub struct Stated {
    /// In words.
    pub words: String,
    /// As it would be seen.
    pub board: SeenBoard,
    /// Side of a marker as a part of its square.
    pub marker_part: Option<f64>,
    /// Diameter of circles as a share of `pitch_mm`.
    pub diameter: Option<f64>,
}

impl Stated {
    fn new(words: String, kind: SeenKind, (rows, cols): (usize, usize)) -> Self {
        Self {
            words,
            board: SeenBoard {
                kind,
                rows,
                cols,
                is_whole: true,
            },
            marker_part: None,
            diameter: None,
        }
    }

    /// A chessboard, `marked` some of its squares.
    pub fn chessboard((rows, cols): (usize, usize), marked: &[(usize, usize)]) -> Self {
        let dots = match marked.len() {
            0 => String::new(),
            count => format!(", {count} squares with a dot"),
        };
        let words = format!("a chessboard of {rows} x {cols} inner corners{dots}");
        let marked = marked.to_vec();
        Self::new(words, SeenKind::Chessboard { marked }, (rows, cols))
    }

    /// A `ChArUco` board.
    pub fn charuco(board: &Charuco) -> Self {
        let legacy = if board.legacy { ", legacy = true" } else { "" };
        let words = format!(
            "a ChArUco board of {} x {} inner corners with {} from {} on{legacy}",
            board.rows,
            board.cols,
            board.codes.name(),
            board.first_id
        );
        let kind = SeenKind::Charuco {
            dictionary: board.codes.name(),
            legacy: board.legacy,
            first_id: board.first_id,
        };
        Self {
            marker_part: Some(board.marker_mm / board.square_mm),
            ..Self::new(words, kind, (board.rows, board.cols))
        }
    }

    /// A grid of tags.
    pub fn april_grid(grid: &AprilGrid) -> Self {
        let name = grid.codes.name();
        let words = format!(
            "a grid of {} x {} tags of {name} from {} on, {} of their side apart",
            grid.rows, grid.cols, grid.first_id, grid.spacing
        );
        let kind = SeenKind::AprilGrid {
            family: name.strip_prefix("DICT_APRILTAG_").unwrap_or(name),
            first_id: Some(grid.first_id),
            spacing: Some(grid.spacing),
        };
        Self::new(words, kind, (grid.rows, grid.cols))
    }

    /// A grid of circles.
    pub fn circles(circles: &Circles) -> Self {
        let kind = if circles.asymmetric {
            "asymmetric"
        } else {
            "symmetric"
        };
        let words = format!(
            "a grid of {} x {} circles, {kind}, {} of them marked, their diameter {:.2} of the pitch",
            circles.rows,
            circles.cols,
            circles.direction.len(),
            circles.diameter_mm / circles.pitch_mm
        );
        let kind = SeenKind::Circles {
            asymmetric: circles.asymmetric,
            direction: circles.direction.clone(),
            diameter: None,
        };
        Self {
            diameter: Some(circles.diameter_mm / circles.pitch_mm),
            ..Self::new(words, kind, (circles.rows, circles.cols))
        }
    }

    /// A grid of rings.
    pub fn rings(target: &TargetSpec) -> Self {
        let words = format!(
            "a grid of {} x {} rings, {} of them larger",
            target.rows,
            target.cols,
            target.direction.len()
        );
        let direction = target.direction.clone();
        let size = (target.rows, target.cols);
        Self::new(words, SeenKind::Rings { direction }, size)
    }

    /// Rows and columns.
    pub fn size(&self) -> (usize, usize) {
        (self.board.rows, self.board.cols)
    }

    /// Number of the first marker.
    pub fn first_id(&self) -> usize {
        match &self.board.kind {
            SeenKind::Charuco { first_id, .. } => *first_id,
            SeenKind::AprilGrid { first_id, .. } => first_id.unwrap_or(0),
            _ => 0,
        }
    }

    /// Marked ones.
    pub fn direction(&self) -> &[(usize, usize)] {
        match &self.board.kind {
            SeenKind::Chessboard { marked } => marked,
            SeenKind::Circles { direction, .. } | SeenKind::Rings { direction } => direction,
            _ => &[],
        }
    }
}
