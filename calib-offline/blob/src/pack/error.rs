//! Why a rig cannot be packed.

use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::remedy::Remedy;
use ray_runtime::format::{MAX_CELLS, MAX_EXTENT_PX};
use ray_runtime::{MatchNoise, OpenError, SelfTestFailure};

/// Why a rig cannot be packed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackError {
    /// A setting is not a positive number.
    #[error("{setting} must be a positive number, not {value}")]
    BadSetting {
        /// Which.
        setting: &'static str,
        /// Its value.
        value: f64,
    },
    /// The noise of matches is none that a blob can say.
    #[error(
        "the noise of matches is {px} px; it must be 0 or {} to {} px",
        MatchNoise::LEAST_PX,
        MatchNoise::MOST_PX
    )]
    MatchNoise {
        /// As stated.
        px: f64,
    },
    /// The sensor is larger than the format allows.
    #[error(
        "the {sensor} sensor of camera `{camera}` does not fit the format: 1 to {MAX_EXTENT_PX} px"
    )]
    SensorSize {
        /// The camera.
        camera: String,
        /// Its sensor.
        sensor: SensorSize,
    },
    /// The mask is not one of the camera's sensor, or has no cells or too many.
    #[error(
        "the mask of camera `{camera}` has {cells_u}x{cells_v} cells over {mask}, \
         the sensor is {sensor}; 1 to {MAX_CELLS} cells are possible"
    )]
    Mask {
        /// The camera.
        camera: String,
        /// Sensor of the mask.
        mask: SensorSize,
        /// Sensor of the field.
        sensor: SensorSize,
        /// Cells along u.
        cells_u: usize,
        /// Cells along v.
        cells_v: usize,
    },
    /// No pixel of a camera is calibrated.
    #[error("camera `{camera}` has no calibrated pixel")]
    NothingCalibrated {
        /// The camera.
        camera: String,
    },
    /// The field is no number, or looks more than 127 degrees off axis, in the calibrated area.
    #[error("the ray of camera `{camera}` at pixel ({:.1}, {:.1}) cannot be packed: {s:?}", pixel.u, pixel.v)]
    Field {
        /// The camera.
        camera: String,
        /// Where.
        pixel: PixelPoint,
        /// Half-angle vector there.
        s: [f64; 2],
    },
    /// The table's equations have no solution.
    #[error("no table of {}x{} cells can be fitted to camera `{camera}`", cells[0], cells[1])]
    Fit {
        /// The camera.
        camera: String,
        /// Cells along u and v.
        cells: [u32; 2],
    },
    /// What a calibration says of a pair's uncertainty is no covariance.
    #[error("the uncertainty of cameras {first} and {second} is not a covariance")]
    Uncertainty {
        /// Index of the first camera.
        first: usize,
        /// Index of the second.
        second: usize,
    },
    /// No table holds the bound.
    #[error(
        "camera `{camera}` cannot be packed within {wanted_px} px: \
         the best table tried, of {}x{} cells, is off by {best_px:.2e} px at worst",
        cells[0], cells[1]
    )]
    BoundNotReached {
        /// The camera.
        camera: String,
        /// The bound asked for, px.
        wanted_px: f64,
        /// The smallest worst error reached, px.
        best_px: f64,
        /// With this grid.
        cells: [u32; 2],
    },
    /// No table within the bound is small enough.
    #[error(
        "{max_bytes} bytes are too few: the smallest blob within {max_error_px:.4} px has {need}"
    )]
    TooFewBytes {
        /// Bytes allowed.
        max_bytes: usize,
        /// Bytes needed.
        need: usize,
        /// The bound, px.
        max_error_px: f64,
    },
    /// The runtime refuses what would be written: a name is empty or taken twice, a number is
    /// too large, a rotation is none.
    #[error("the runtime would refuse the blob: {0}")]
    Refused(#[from] OpenError),
    /// The runtime does not repeat its own answers.
    #[error("self-test {} of the blob fails on this machine", .0.test)]
    SelfTest(SelfTestFailure),
    /// The arithmetic of integers has no place for the rig's numbers.
    #[error("integers cannot look this rig up: {0}")]
    Integers(ray_runtime::integer::Unsuited),
    /// The arithmetic of integers has no ray where there should be one, or no point.
    #[error(
        "integers have no ray at some calibrated pixel of camera `{camera}`, or another where there should be none"
    )]
    IntegerRays {
        /// The camera.
        camera: String,
    },
    /// The blob would be larger than its length field can say.
    #[error("the blob would have {bytes} bytes; the format ends at 4 GiB")]
    TooLarge {
        /// Bytes.
        bytes: usize,
    },
}

impl Remedy for PackError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::BadSetting { .. } => "give a bound in pixels such as 0.001".to_owned(),
            Self::MatchNoise { .. } => {
                "give the standard deviation of a matched pixel with --match-noise-px".to_owned()
            }
            Self::BoundNotReached { best_px, .. } => {
                format!(
                    "ask for more: --max-error-px {:.1e} or above",
                    1.1 * best_px
                )
            }
            Self::TooFewBytes { need, .. } => format!(
                "allow {need} bytes, a larger --max-error-px, or leave the uncertainty out with --no-uncertainty"
            ),
            Self::Integers(_) | Self::IntegerRays { .. } => {
                "pack without --arithmetic integer: devices with a floating-point unit need none of it"
                    .to_owned()
            }
            Self::NothingCalibrated { .. } => {
                "calibrate with corners over more of the sensor".to_owned()
            }
            _ => {
                "check the lengths and the camera names with calib-offline inspect: a blob holds up to \
                 a kilometer and needs names that differ"
                    .to_owned()
            }
        };
        Some(text)
    }
}
