//! Why rays cannot be written for another tool.

use calib_rays::remedy::Remedy;

/// Why a rig cannot be written in a format.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExchangeError {
    /// Too small a calibrated area.
    #[error(
        "camera \"{camera}\": its calibrated area has {have} places of the lattice, a pinhole takes {need}"
    )]
    TooFewRays {
        /// The camera.
        camera: String,
        /// Places with a ray.
        have: usize,
        /// At least.
        need: usize,
    },
    /// Rays that a pinhole cannot have.
    #[error("camera \"{camera}\": no pinhole comes near its rays ({reason})")]
    NoPinhole {
        /// The camera.
        camera: String,
        /// What stands against it.
        reason: &'static str,
    },
    /// A name that no file of the format can have.
    #[error("camera \"{camera}\": the format has no place for a camera of that name")]
    Name {
        /// The camera.
        camera: String,
    },
}

impl Remedy for ExchangeError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::TooFewRays { .. } => "record boards that cover the image, and calibrate again",
            Self::NoPinhole { .. } => {
                "take the rays themselves: --format npy, or calib-offline rays"
            }
            Self::Name { .. } => {
                "rename the camera with letters, digits, - and _, and not \"extrinsics\""
            }
        };
        Some(text.to_owned())
    }
}
