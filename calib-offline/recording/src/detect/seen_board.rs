//! A target that an image shows instead of the one described.

/// A target that an image shows.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SeenBoard {
    /// A chessboard without markers.
    Chessboard {
        /// Inner corners along the shorter direction.
        rows: usize,
        /// Inner corners along the longer direction.
        cols: usize,
    },
    /// A `ChArUco` board.
    Charuco {
        /// Rows of inner corners.
        rows: usize,
        /// Columns of inner corners.
        cols: usize,
        /// `OpenCV`'s name of its markers.
        dictionary: &'static str,
        /// Whether it is of the old pattern.
        legacy: bool,
        /// Its first marker.
        first_id: usize,
    },
    /// A grid of circles.
    Circles {
        /// Rows.
        rows: usize,
        /// Columns.
        cols: usize,
        /// Whether every other row is shifted.
        asymmetric: bool,
        /// Circles that are marked.
        marked: usize,
    },
    /// Coded markers, on what is unclear.
    Markers {
        /// `OpenCV`'s name of their dictionary.
        dictionary: &'static str,
        /// How many.
        count: usize,
    },
}

impl std::fmt::Display for SeenBoard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Chessboard { rows, cols } => {
                write!(f, "a chessboard with {rows} x {cols} inner corners")
            }
            Self::Charuco {
                rows,
                cols,
                dictionary,
                legacy,
                ..
            } => {
                let pattern = if *legacy { ", of the old pattern" } else { "" };
                write!(
                    f,
                    "a ChArUco board of {rows} x {cols} inner corners with {dictionary}{pattern}"
                )
            }
            Self::Circles {
                rows, cols, marked, ..
            } => write!(f, "{rows} x {cols} circles, {marked} of them marked"),
            Self::Markers { dictionary, count } => {
                write!(
                    f,
                    "{count} markers of {dictionary}, not where they should be"
                )
            }
        }
    }
}

impl SeenBoard {
    /// The lines for the manifest, if this is what was meant.
    pub(super) fn what_to_write(&self) -> String {
        let lines = match self {
            Self::Chessboard { rows, cols } => {
                format!("kind = \"chessboard\", rows = {rows}, cols = {cols}")
            }
            Self::Charuco {
                rows,
                cols,
                dictionary,
                legacy,
                first_id,
            } => {
                let first = match first_id {
                    0 => String::new(),
                    id => format!(", first_id = {id}"),
                };
                format!(
                    "kind = \"charuco\", rows = {rows}, cols = {cols}, dictionary = \"{dictionary}\", legacy = {legacy}{first}"
                )
            }
            Self::Circles {
                rows,
                cols,
                asymmetric,
                ..
            } => format!(
                "kind = \"circles\", rows = {rows}, cols = {cols}, asymmetric = {asymmetric}, and the marked ones in direction"
            ),
            Self::Markers { dictionary, .. } => {
                return format!(
                    "if dictionary = \"{dictionary}\" is right, check rows, cols (inner corners, not squares), legacy and first_id"
                );
            }
        };
        format!("if this is the right board, write {lines}")
    }
}
