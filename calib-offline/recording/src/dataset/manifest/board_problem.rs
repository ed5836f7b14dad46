//! What can be wrong with a printed target in `dataset.toml`.

use super::limits::{MAX_SQUARE_MM, MIN_SQUARE_MM};
use crate::dataset::target::TargetSymmetry;
use calib_rays::print::Codes;

/// What is wrong with `[board]`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BoardProblem {
    /// A key that this kind takes is not there.
    #[error("[board] {key} is missing, and kind = \"{kind}\" needs it")]
    Missing {
        /// The key.
        key: &'static str,
        /// The kind.
        kind: &'static str,
    },
    /// No length.
    #[error("[board] {key} = {value} is no length between {MIN_SQUARE_MM} and {MAX_SQUARE_MM} mm")]
    Length {
        /// The key.
        key: &'static str,
        /// The value.
        value: f64,
    },
    /// Something that does not fit into what is around it.
    #[error("[board] {inner} = {inner_mm} does not fit: {outer} = {outer_mm}")]
    TooLarge {
        /// Key of the inner length.
        inner: &'static str,
        /// Its value, mm.
        inner_mm: f64,
        /// Key of the outer length.
        outer: &'static str,
        /// Its value, mm.
        outer_mm: f64,
    },
    /// A dictionary that is not known.
    #[error("[board] {key} = \"{name}\" is not known")]
    Dictionary {
        /// The key.
        key: &'static str,
        /// The name.
        name: String,
    },
    /// More markers than the dictionary has.
    #[error("the board has markers {first} to {last}, and {dictionary} ends at {end}")]
    TooManyMarkers {
        /// Number of the first marker.
        first: usize,
        /// Number of the last.
        last: usize,
        /// Name of the dictionary.
        dictionary: &'static str,
        /// Number of its last marker.
        end: usize,
    },
    /// A space between tags that cannot be meant.
    #[error("[board] spacing = {value} is no share of tag_mm between 0.05 and 2")]
    Spacing {
        /// The value.
        value: f64,
    },
    /// A border that no tags have.
    #[error("[board] border_bits = {value} is no border of a tag")]
    Border {
        /// The value.
        value: i64,
    },
    /// A marked circle or square that is no place on the grid.
    #[error("[board]: [{}] is no [row, col] of {rows} rows and {cols} cols", place.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))]
    Direction {
        /// What stands there.
        place: Vec<i64>,
        /// Rows of the grid.
        rows: usize,
        /// Columns of the grid.
        cols: usize,
    },
    /// Rectangles in as many rows as columns.
    #[error(
        "[board] square_height_mm is not square_mm, and rows = cols: after a quarter turn the image is the same"
    )]
    WhichSide,
    /// Marked ones that tell no direction.
    #[error("[board] {key}: the target looks the same {symmetry}, its marks included")]
    Symmetric {
        /// The key.
        key: &'static str,
        /// After which turn or mirror.
        symmetry: TargetSymmetry,
    },
}

impl BoardProblem {
    /// What to do about it.
    pub fn remedy(&self) -> String {
        let text = match self {
            Self::Missing { key, .. } => return format!("add {key} to [board]"),
            Self::Length { .. } => "write it in millimeters",
            Self::TooLarge { .. } => "measure both on the print, in millimeters",
            Self::Dictionary { key: "family", .. } => {
                "write family = \"36h11\", \"36h10\", \"25h9\" or \"16h5\""
            }
            Self::Dictionary { .. } => {
                return format!("write one of {}", Codes::names().join(", "));
            }
            Self::TooManyMarkers { .. } => "correct rows, cols, first_id or the dictionary",
            Self::Spacing { .. } => {
                "write the space between two tags divided by a tag's side, such as 0.3"
            }
            Self::Border { .. } => {
                "write 1 or 2, the black cells around a tag's code, or leave it away: the images tell"
            }
            Self::Direction { .. } => "count rows and columns from 0, such as [[3, 4], [1, 2]]",
            Self::Symmetric { .. } => {
                "mark others, so that no turn and no mirror maps the marks onto themselves, or leave the key away if none are printed"
            }
            Self::WhichSide => {
                "use a board with unlike counts of rows and columns: only they tell in an image which side of its squares is the higher one"
            }
        };
        text.to_owned()
    }
}
