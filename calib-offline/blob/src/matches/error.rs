//! What can be wrong with a file of matches.

use calib_rays::remedy::Remedy;
use std::path::PathBuf;

/// Why `MATCHES.csv` was not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MatchesError {
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// There is not even a header.
    #[error("{}:1: is empty; the header must be \"{expected}\"", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
        /// A header that fits the rig.
        expected: String,
    },
    /// The first line does not name an id and two or more cameras of the rig.
    #[error("{}:1: the header is \"{found}\"; {problem}; for this rig it would be \"{expected}\"", file.display())]
    Header {
        /// The file.
        file: PathBuf,
        /// What stands there, shortened.
        found: String,
        /// What is wrong with it.
        problem: HeaderProblem,
        /// A header that fits the rig.
        expected: String,
    },
    /// The table of true points beside the matches cannot be read.
    #[error("{}: is no table of true points", file.display())]
    Truth {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        source: csv::Error,
    },
    /// The table of true points does not go with its matches.
    #[error("{}: has {have} rows, its matches {need}", file.display())]
    TruthCount {
        /// The file.
        file: PathBuf,
        /// Rows.
        have: usize,
        /// Matches.
        need: usize,
    },
    /// An id that is asked for, and that two matches have.
    #[error("{}:{line}: the id \"{id}\" stands in line {first_line} already", file.display())]
    IdTwice {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// From 1.
        first_line: usize,
        /// The id.
        id: String,
    },
    /// A line that is no match.
    #[error("{}:{line}: {problem}", file.display())]
    Row {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// What is wrong with it.
        problem: RowProblem,
    },
}

/// What is wrong with a header.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum HeaderProblem {
    /// The first column is not `id`.
    #[error("the first column must be id")]
    NoId,
    /// A column that is no pixel of a camera.
    #[error("the column \"{column}\" is not known")]
    UnknownColumn {
        /// Its name, shortened.
        column: String,
    },
    /// `u_NAME` without `v_NAME` behind it, or the reverse.
    #[error("u_{camera} and v_{camera} must stand side by side, u first")]
    NoPair {
        /// The camera.
        camera: String,
    },
    /// A camera that the rig does not have.
    #[error("the rig has no camera \"{camera}\"")]
    UnknownCamera {
        /// The camera.
        camera: String,
    },
    /// A camera twice.
    #[error("camera \"{camera}\" stands there twice")]
    CameraTwice {
        /// The camera.
        camera: String,
    },
    /// Fewer than two cameras.
    #[error("a point takes the pixels of at least two cameras")]
    TooFewCameras,
    /// Not the header of a list of pixels.
    #[error("a list of pixels has an id and one pixel")]
    NoList,
}

/// What is wrong with a row.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RowProblem {
    /// Not UTF-8.
    #[error("is not text (no UTF-8)")]
    NotText,
    /// Too few or too many fields.
    #[error("has {have} fields, the header has {need}")]
    FieldCount {
        /// Fields.
        have: usize,
        /// Columns.
        need: usize,
    },
    /// A quoted id that does not end in its line.
    #[error("the id begins with a quote that does not end")]
    OpenQuote,
    /// A pixel that is no number.
    #[error("\"{text}\" is not a pixel coordinate")]
    NotANumber {
        /// The field, shortened.
        text: String,
    },
    /// A pixel that is not finite.
    #[error("the pixel coordinate {text} is not finite")]
    NotFinite {
        /// The field, shortened.
        text: String,
    },
    /// Only one of u and v is given.
    #[error("one of u and v is empty and the other is not")]
    HalfPixel,
    /// A row of a list of pixels without one.
    #[error("u and v are empty")]
    NoPixel,
    /// Fewer than two cameras saw the point.
    #[error("{have} of the cameras saw this point, it takes 2")]
    TooFewPixels {
        /// Pixels given.
        have: usize,
    },
    /// More cameras than a device takes at once.
    #[error("{have} of the cameras saw this point, a device measures with 2")]
    TooManyPixels {
        /// Pixels given.
        have: usize,
    },
}

impl Remedy for MatchesError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Read { .. } => "check the path and the permissions",
            Self::Empty { .. } => "write the header and one match per line",
            Self::Header { found, .. } if found.contains([';', '\t']) => {
                "save the file with commas between the fields"
            }
            Self::Header { .. } => {
                "name the columns after the rig's cameras; calib-offline inspect RIG lists them"
            }
            Self::Truth { .. } | Self::TruthCount { .. } => {
                "simulate the dataset again, or take the table away: without it nothing is compared \
                 with the truth"
            }
            Self::IdTwice { .. } => "give each match that is an end of a length an id of its own",
            Self::Row { problem, .. } => match problem {
                RowProblem::NotText => "save the file as UTF-8 text",
                RowProblem::FieldCount { .. } => {
                    "each line has one match; decimal points are points, not commas"
                }
                RowProblem::OpenQuote => "close the quote, or take it away",
                RowProblem::NotANumber { .. } | RowProblem::NotFinite { .. } => {
                    "give pixels as numbers; leave both u and v empty for a camera that did not see the point"
                }
                RowProblem::NoPixel | RowProblem::HalfPixel | RowProblem::TooFewPixels { .. } => {
                    "give u and v for at least two cameras, or take the line away"
                }
                RowProblem::TooManyPixels { .. } => {
                    "leave u and v empty but for two cameras, or measure here, with the blob"
                }
            },
        };
        Some(text.to_owned())
    }
}

/// The first characters of something that may be long or unprintable.
pub(super) fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(60).flat_map(char::escape_debug).collect();
    if text.chars().nth(60).is_some() {
        short.push_str("...");
    }
    short
}
