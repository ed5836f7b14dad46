//! Why rays cannot be written for another tool.

use calib_rays::remedy::Remedy;

/// Why a rig cannot be written in a format.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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
    #[error("camera \"{camera}\": no lens of the form comes near its rays ({reason})")]
    NoPinhole {
        /// The camera.
        camera: String,
        /// What stands against it.
        reason: &'static str,
    },
    /// A part of the sensor that is not on it.
    #[error(
        "camera \"{camera}\": the region does not lie on its sensor, which spans -0.5 to {} and -0.5 to {} px",
        f64::from(sensor[0]) - 0.5, f64::from(sensor[1]) - 0.5
    )]
    Region {
        /// The camera.
        camera: String,
        /// Width and height, px.
        sensor: [u32; 2],
    },
    /// A rig that is no pair.
    #[error("the rig has {have} cameras, and a rectified pair is of two")]
    NoPair {
        /// Its cameras.
        have: usize,
    },
    /// Cameras that see nothing together.
    #[error("cameras \"{first}\" and \"{second}\": no point at {distance_mm} mm is seen by both")]
    NoOverlap {
        /// The first camera.
        first: String,
        /// The second one.
        second: String,
        /// Where it was looked for.
        distance_mm: f64,
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
                "take another model (--model equidistant for a fisheye), or the rays themselves: --format npy, or calib-offline rays"
            }
            Self::Region { .. } => "give --region u0,v0,u1,v1 within the sensor",
            Self::NoPair { .. } => {
                "export --format remap: it has the maps of each camera by itself"
            }
            Self::NoOverlap { .. } => {
                "say with --distance-mm where both cameras look; or export --format remap, a camera by itself"
            }
            Self::Name { .. } => {
                "rename the camera with letters, digits, - and _, and not \"extrinsics\""
            }
        };
        Some(text.to_owned())
    }
}
