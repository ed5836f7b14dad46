//! Why a mesh cannot be made.

use crate::error::ExchangeError;
use calib_rays::remedy::Remedy;

/// Why a mesh cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// Rays that no pinhole comes near.
    #[error("the mesh has no output image")]
    Rays(#[from] ExchangeError),
    /// A step that the format does not have.
    #[error("{format}: nodes cannot lie {step} px apart")]
    Step {
        /// The format.
        format: &'static str,
        /// What was asked for, px.
        step: u32,
        /// What there is.
        steps: &'static str,
    },
    /// A sensor that the format's integers or the chip cannot hold.
    #[error("{format}: camera \"{camera}\" has {} x {} px, and the format takes {takes}", sensor[0], sensor[1])]
    Sensor {
        /// The format.
        format: &'static str,
        /// The camera.
        camera: String,
        /// Width and height, px.
        sensor: [u32; 2],
        /// What it takes.
        takes: &'static str,
    },
    /// A step that leaves a rest.
    #[error("{format}: {step} px do not divide the {} x {} px of camera \"{camera}\"", sensor[0], sensor[1])]
    Rest {
        /// The format.
        format: &'static str,
        /// The camera.
        camera: String,
        /// Width and height, px.
        sensor: [u32; 2],
        /// The step, px.
        step: u32,
    },
    /// A number beyond the format's integers.
    #[error(
        "{format}: camera \"{camera}\" needs an offset of {offset_px:.3} px, and the format holds {least_px} to {most_px} px"
    )]
    Range {
        /// The format.
        format: &'static str,
        /// The camera.
        camera: String,
        /// The offset, px.
        offset_px: f64,
        /// The format's least, px.
        least_px: f64,
        /// The format's most, px.
        most_px: f64,
    },
    /// An output image that shows nothing calibrated.
    #[error("camera \"{camera}\": no node of the mesh sees what a calibrated pixel does")]
    NothingSeen {
        /// The camera.
        camera: String,
    },
    /// Cameras that do not stand side by side.
    #[error("the line from the first camera to the second is no row of their images")]
    NoPair,
}

impl Remedy for MeshError {
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::Rays(error) => return error.remedy(),
            Self::Step { steps, .. } => format!("give --step {steps}"),
            Self::Sensor { .. } => {
                "calibrate the image that the chip gets: cropped, or with another binning"
                    .to_owned()
            }
            Self::Rest { .. } => "give a --step that divides width and height".to_owned(),
            Self::Range { .. } => {
                "bring the output image nearer to the camera's own with --zoom".to_owned()
            }
            Self::NothingSeen { .. } => "give a smaller --step or a larger --zoom".to_owned(),
            Self::NoPair => {
                "take a camera by itself with --camera, or --format mesh: they are not rectified"
                    .to_owned()
            }
        })
    }
}
