//! Why a calibration cannot be held against a dataset.

use crate::methods::MethodError;
use calib_rays::board::{BoardSpec, Layout};
use calib_rays::remedy::Remedy;

/// Why a calibration cannot be held against a dataset.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// A calibration that came from another tool.
    #[error(
        "the calibration was imported: it holds no corners, and what it leaves open is not known"
    )]
    Imported,
    /// A calibration without the corners that it was made from.
    #[error("the calibration holds no corners: what it leaves open is not known")]
    NoOldCorners,
    /// A camera that was not calibrated.
    #[error("the dataset has a camera \"{name}\", the calibration has {}", known.join(", "))]
    UnknownCamera {
        /// Its name.
        name: String,
        /// Those of the calibration.
        known: Vec<String>,
    },
    /// A calibrated camera that did not record.
    #[error("the dataset has no camera \"{name}\", which the calibration has")]
    MissingCamera {
        /// Its name.
        name: String,
    },
    /// Images of another size.
    #[error("camera {name} has {} x {} px in the dataset, and {} x {} in the calibration", new[0], new[1], old[0], old[1])]
    OtherSensor {
        /// The camera.
        name: String,
        /// Width and height that were calibrated.
        old: [u32; 2],
        /// Those of the dataset.
        new: [u32; 2],
    },
    /// Another board.
    #[error(
        "the dataset has a board of {}, the calibration was made from {}",
        words(new),
        words(old)
    )]
    OtherBoard {
        /// Of the calibration.
        old: BoardSpec,
        /// Of the dataset.
        new: BoardSpec,
    },
    /// No new board could be placed.
    #[error("no board of the dataset can be placed with the calibration, of {corners} corners")]
    NoBoard {
        /// Corners in all views.
        corners: usize,
    },
    /// The old corners give no estimate.
    #[error("the corners in the calibration give no estimate")]
    Method(#[from] MethodError),
}

fn words(board: &BoardSpec) -> String {
    let (rows, cols, square_mm) = (board.rows, board.cols, board.square_mm);
    match board.layout {
        Layout::Points(_) => format!("{cols} points"),
        Layout::Rectangles(height_mm) => {
            format!("{rows} x {cols} corners and squares of {square_mm} x {height_mm} mm")
        }
        Layout::Grid | Layout::Face(_) => {
            format!("{rows} x {cols} corners and {square_mm} mm squares")
        }
    }
}

impl VerifyError {
    /// Whether the input can be used, and the data cannot determine the answer.
    pub fn is_undetermined(&self) -> bool {
        matches!(self, Self::NoBoard { .. } | Self::Method(_))
    }
}

impl Remedy for VerifyError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Imported => "judge it on the new poses with calib-offline audit",
            Self::NoOldCorners => {
                "verify with a calibration.json that calib-offline calibrate wrote"
            }
            Self::UnknownCamera { .. } | Self::MissingCamera { .. } => {
                "record with all cameras of the calibration, under their names there"
            }
            Self::OtherSensor { .. } => {
                "record with the resolution, binning and region of the calibration, or calibrate again"
            }
            Self::OtherBoard { .. } => {
                "show the board that the calibration was made from, with its rows, cols and square_mm: its shape is \
                 known; or calibrate again with the other one"
            }
            Self::NoBoard { .. } => {
                "show the board as for a calibration: calib-offline detect DATASET --overlay DIR says what is seen of \
                 it; if it is seen well, calibrate again"
            }
            Self::Method(error) => return error.remedy(),
        };
        Some(text.to_owned())
    }
}
