//! What the demo measures with a calibration once it is packed: the device's own code on boards
//! that no training pose had, on matches whose truth is known, and on devices, whose answers must
//! be those of the host to the last bit.

pub mod device;
pub mod page;
pub mod unseen;
pub mod words;

use calib_blob::pack::PackError;
use calib_judge::known_points::KnownPoints;
use calib_rays::remedy::Remedy;
use firmware_sim::client::ClientError;
use ray_runtime::OpenError;
use serde::Serialize;

pub use device::DeviceCheck;
pub use unseen::UnseenBoards;

/// Everything measured on one dataset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// Held-out boards, each fold through a blob of its own; none if the dataset has too few
    /// poses, or one camera.
    pub unseen_boards: Option<UnseenBoards>,
    /// Files of matches whose truth is known; empty for a real recording.
    pub known_points: Vec<KnownPoints>,
    /// The same matches on devices.
    pub devices: Vec<DeviceCheck>,
    /// Why there is no Cortex-M among them.
    pub no_cortex_m: Option<String>,
}

/// Why the demo cannot measure.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DemoError {
    /// The blob just packed does not open.
    #[error("the runtime refuses the blob just packed: {0}")]
    Open(#[from] OpenError),
    /// The rig of a fold cannot be packed.
    #[error("the rig of a fold cannot be packed")]
    Pack(#[from] PackError),
    /// The simulated device cannot listen.
    #[error("the simulated device cannot be started")]
    Start(#[source] std::io::Error),
    /// The simulated device does not answer.
    #[error("the simulated device does not answer")]
    Device(#[from] ClientError),
}

impl Remedy for DemoError {
    fn remedy(&self) -> Option<String> {
        match self {
            Self::Pack(error) => error.remedy(),
            Self::Open(_) | Self::Start(_) | Self::Device(_) => None,
        }
    }
}
