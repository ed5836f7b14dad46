//! Why a calibration of another tool cannot be used: the file, the key, and what to do.

use calib_rays::remedy::Remedy;
use std::path::{Path, PathBuf};

/// A problem, and the file that has it.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", file.display())]
pub struct ImportError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a calibration of another tool.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The system refused to read it.
    #[error("cannot be read: {0}")]
    Read(String),
    /// No format that is known.
    #[error("is no calibration in a format that is read")]
    UnknownFormat,
    /// It is broken.
    #[error("line {line}: {message}")]
    Syntax {
        /// From 1.
        line: usize,
        /// What the reader says.
        message: String,
    },
    /// A key is not there.
    #[error("has no key \"{key}\"")]
    Missing {
        /// The key, those above it before.
        key: String,
    },
    /// A key twice.
    #[error("has the key \"{key}\" twice")]
    Twice {
        /// The key.
        key: String,
    },
    /// Another kind of value.
    #[error("\"{key}\" is {found}, not {wanted}")]
    Wrong {
        /// The key.
        key: String,
        /// What stands there.
        found: String,
        /// What ought to.
        wanted: String,
    },
    /// NaN or infinite.
    #[error("\"{key}\" has a value that is not finite")]
    NotFinite {
        /// The key.
        key: String,
    },
    /// Two places that contradict each other.
    #[error("\"{key}\" contradicts {other}")]
    Disagrees {
        /// The key.
        key: String,
        /// With what.
        other: String,
    },
    /// A model that is not known.
    #[error("\"{key}\": there is no model \"{found}\"; known are {known}")]
    Model {
        /// The key.
        key: String,
        /// The file's.
        found: String,
        /// Those read.
        known: &'static str,
    },
    /// The format says no unit.
    #[error("does not say the unit of its lengths")]
    NeedsUnit,
    /// It says no size.
    #[error("does not say the size of the images")]
    NeedsSize,
    /// Four coefficients.
    #[error("does not say whether its four coefficients are those of a pinhole or of a fisheye")]
    NeedsModel,
    /// MATLAB's rotation.
    #[error("\"{key}\" does not say whether points are rows before it or columns behind it")]
    NeedsRotationForm {
        /// The key.
        key: String,
    },
    /// A table of values.
    #[error("does not say what it counts pixels from")]
    NeedsPixelOrigin,
    /// Corners row by row.
    #[error("does not say how many rows and columns of corners the board has")]
    NeedsGrid,
    /// Images by their names.
    #[error("does not say which image is of which camera and pose")]
    NeedsImages,
    /// Nothing in it.
    #[error("holds no corners")]
    NoCorners,
    /// Several cameras, and nobody says where they stand.
    #[error("does not say where its cameras stand to each other")]
    NoExtrinsics,
    /// A name that two cameras have.
    #[error("two cameras are called \"{name}\"")]
    SameName {
        /// The name.
        name: String,
    },
    /// Names for another number of cameras.
    #[error("{given} names are given for {found} cameras")]
    Names {
        /// Names.
        given: usize,
        /// Cameras.
        found: usize,
    },
    /// A model without rays.
    #[error("camera \"{camera}\": no part of its image can be turned into rays")]
    NoRays {
        /// The camera.
        camera: String,
    },
    /// Files that do not go together.
    #[error("does not go with {other}: {why}")]
    Apart {
        /// Another file.
        other: String,
        /// Why.
        why: &'static str,
    },
}

impl Problem {
    /// With the file.
    pub fn in_file(self, file: &Path) -> ImportError {
        ImportError {
            file: file.to_owned(),
            problem: self,
        }
    }
}

impl Remedy for ImportError {
    fn remedy(&self) -> Option<String> {
        let text = match &self.problem {
            Problem::Read(_) => "check the path and the permissions",
            Problem::UnknownFormat => {
                "hand in a file of OpenCV, ROS, Kalibr, mrcal, COLMAP (cameras.txt), MATLAB (as JSON) or DICe, see docs/EXCHANGE.md"
            }
            Problem::Syntax { .. } | Problem::Twice { .. } => {
                "the file was damaged or edited: write it again with the tool that made it"
            }
            Problem::Missing { .. } | Problem::Wrong { .. } => {
                "write the file again with the tool that made it, or add what is missing by its documentation; docs/EXCHANGE.md has the keys"
            }
            Problem::NotFinite { .. } => {
                "the calibration did not come out: calibrate again with that tool"
            }
            Problem::Disagrees { .. } => "one of both was edited: keep the one that is right",
            Problem::Model { .. } => {
                "convert it to a model that is read with the tool that made it, or export dense rays from there"
            }
            Problem::NeedsUnit => "say it with --unit mm or --unit m",
            Problem::NeedsSize => "say it with --size WIDTHxHEIGHT",
            Problem::NeedsModel => "say it with --model pinhole or --model fisheye",
            Problem::NeedsRotationForm { .. } => {
                "say it with --rotation row (RotationOfCamera2, x2 = x1 R + t) or --rotation column (x2 = R x1 + t)"
            }
            Problem::NeedsPixelOrigin => {
                "say what the center of the top-left pixel is there with --pixel-origin 0, 0.5 or 1"
            }
            Problem::NeedsGrid => "say it with --board ROWSxCOLS, inner corners",
            Problem::NeedsImages => {
                "say it with --images NAME=PATTERN for each camera, such as --images left=left-*.png"
            }
            Problem::NoCorners => "look into the file: was a board found in any image?",
            Problem::NoExtrinsics => {
                "add the file that says it (OpenCV's extrinsics with R and T), or take one camera with --camera NAME"
            }
            Problem::SameName { .. } | Problem::Names { .. } => {
                "name the cameras in the order of the files with --names A,B"
            }
            Problem::NoRays { .. } => {
                "its numbers are those of no lens: check them, and the order of the coefficients"
            }
            Problem::Apart { .. } => "hand in the files of one rig by one tool",
        };
        Some(text.to_owned())
    }
}
