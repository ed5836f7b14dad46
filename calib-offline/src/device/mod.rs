//! A device as the command line uses it: opened by its address, asked for points, and described.
//!
//! The messages are `ray_device`'s, the connection is `firmware_sim`'s; what an answer means to a user is said here.

mod points;
mod state;
mod words;

pub use points::{DeviceSource, on_wire};
pub use state::{BlobState, DeviceState, SlotState};
pub use words::state_in_words;

use calib_rays::remedy::Remedy;
use firmware_sim::client::{ClientError, DeviceClient};
use ray_device::protocol::Refusal;
use std::time::Duration;

/// Why a device did not do what it was asked for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// It could not be asked, or refused.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// It has nothing to measure with.
    #[error("the device at {address} has no blob it can measure with (code {open_error})")]
    NoBlob {
        /// As given.
        address: String,
        /// The runtime's code.
        open_error: u8,
    },
    /// Its blob has more cameras than a device names.
    #[error(
        "the device's blob has {count} cameras and a device names the first {named}: the columns of the matches cannot be told apart"
    )]
    TooManyCameras {
        /// Cameras of the blob.
        count: usize,
        /// Cameras named.
        named: usize,
    },
    /// Its blob has one camera.
    #[error("the device's blob has one camera, a point takes two")]
    OneCamera,
    /// It computes in another arithmetic than the one asked for.
    #[error("the device at {address} does not compute in integers")]
    NotInIntegers {
        /// As given.
        address: String,
    },
    /// It is older than requests that say how noisy matches are.
    #[error("the device's firmware does not take the noise of matches with a request")]
    NoMatchNoise,
    /// A code that this program does not know.
    #[error("the device gave code {code} in place of a point, which this program does not know")]
    UnknownOutcome {
        /// The code.
        code: u8,
    },
}

impl Remedy for DeviceError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Client(error) => return client_remedy(error).map(str::to_owned),
            Self::NoBlob { .. } => {
                "flash one with calib-offline flash RIG.rays --device ADDRESS; calib-offline device status says what is wrong"
            }
            Self::TooManyCameras { .. } => "measure here, with the blob",
            Self::NotInIntegers { .. } => {
                "measure without --arithmetic integer, or have the device's builder choose them (firmware-sim host --arithmetic integer)"
            }
            Self::OneCamera => "calibrate two cameras together; a single one gives rays only",
            Self::NoMatchNoise => "bring its firmware up to date, or measure here, with the blob",
            Self::UnknownOutcome { .. } => "bring this program up to date",
        };
        Some(text.to_owned())
    }
}

/// The next step, where the error does not name it itself.
fn client_remedy(error: &ClientError) -> Option<&'static str> {
    match error {
        ClientError::Connect { address, .. } if address.starts_with("tcp:") => Some(
            "start one with firmware-sim host --listen 127.0.0.1:7777, or give the address of yours",
        ),
        ClientError::NotABlob(_) => Some("write one with calib-offline pack"),
        ClientError::GaveUp { source, .. } => client_remedy(source).or(Some(
            "check the link and flash again: what has arrived is not sent twice",
        )),
        ClientError::Broken { .. } | ClientError::Closed { .. } => {
            Some("check the link and try again: the device keeps its blob")
        }
        ClientError::Refused(Refusal::OtherRig { .. }) => {
            Some("see calib-offline device status for the cameras that the device has")
        }
        _ => None,
    }
}

/// Connects to the device at an address such as `tcp:127.0.0.1:7777` or `serial:/dev/ttyACM0`.
///
/// # Errors
/// [`DeviceError`], after `timeout` at the latest.
pub fn connect(address: &str, timeout: Duration) -> Result<DeviceClient, DeviceError> {
    Ok(DeviceClient::connect_within(address, timeout)?)
}
