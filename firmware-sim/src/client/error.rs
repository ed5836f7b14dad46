//! Why a device gave no answer, in words that say what to look at.

use std::io::ErrorKind;
use std::time::Duration;

use ray_runtime::OpenError;
use thiserror::Error;

use ray_device::protocol::{Refusal, Reply};

/// Why a device gave no answer, or not the one asked for.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The address is of no known kind.
    #[error(
        "`{address}` is no device address: give tcp:HOST:PORT, such as tcp:127.0.0.1:7777, or serial:PORT, such as serial:/dev/ttyACM0 or serial:/dev/ttyUSB0@115200"
    )]
    UnknownAddress {
        /// As given.
        address: String,
    },
    /// Serial ports were left out when this program was built.
    #[error(
        "`{address}` is a serial port, and this program was built without them: build it with --features serial"
    )]
    NoSerial {
        /// As given.
        address: String,
    },
    /// Nobody listens there, or there is no such port.
    #[error("no device at {address}: {}", connect_advice(address, source))]
    Connect {
        /// As given.
        address: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// Something answers, but no device of this kind.
    #[error(
        "what answers at {address} is no device of this kind ({bytes} bytes that make no sense): is the address right, and the baud rate?"
    )]
    NotADevice {
        /// As given.
        address: String,
        /// How many bytes came.
        bytes: usize,
    },
    /// The file is no blob; nothing was sent.
    #[error("this is no blob that can be flashed: {0}")]
    NotABlob(OpenError),
    /// The connection broke.
    #[error("the connection to {address} broke")]
    Broken {
        /// As given.
        address: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The device closed the connection.
    #[error("the device at {address} closed the connection")]
    Closed {
        /// As given.
        address: String,
    },
    /// No answer came in time.
    #[error(
        "no answer from {address} within {} s: is it a device of this kind, and is nobody else connected to it?",
        timeout.as_secs_f32()
    )]
    Timeout {
        /// As given.
        address: String,
        /// How long was waited.
        timeout: Duration,
    },
    /// The device speaks another version of the protocol.
    #[error(
        "the device speaks protocol version {device}, this program version {ours}: bring the older one up to date"
    )]
    WrongVersion {
        /// The device's version.
        device: u8,
        /// The version spoken here.
        ours: u8,
    },
    /// An update did not get through, however often it was resumed.
    #[error("the blob did not get through in {tries} tries; the device keeps the one it had")]
    GaveUp {
        /// How many.
        tries: u32,
        /// Why the last one failed.
        source: Box<Self>,
    },
    /// The device refused the request.
    #[error("the device refused: {0}")]
    Refused(Refusal),
    /// What came back is no answer to what was asked, or cannot be read.
    #[error("the device's answer to {asked} makes no sense: {found}")]
    BadReply {
        /// The request.
        asked: &'static str,
        /// What came instead.
        found: String,
    },
}

impl ClientError {
    /// Whether the same may work a moment later, over a new connection if need be.
    pub fn is_passing(&self) -> bool {
        match self {
            Self::Connect { source, .. } => !matches!(
                source.kind(),
                ErrorKind::PermissionDenied | ErrorKind::InvalidInput
            ),
            Self::Broken { .. }
            | Self::Closed { .. }
            | Self::Timeout { .. }
            | Self::BadReply { .. }
            | Self::NotADevice { .. } => true,
            Self::Refused(refusal) => matches!(
                refusal,
                Refusal::Oversized { .. }
                    | Refusal::BadFrame
                    | Refusal::BadChecksum
                    | Refusal::UnknownMessage
                    | Refusal::WrongOffset { .. }
                    | Refusal::NoUpdate
                    | Refusal::WrongPiece { .. }
                    | Refusal::Incomplete { .. }
                    | Refusal::ChecksumMismatch { .. }
                    | Refusal::FlashFailed { .. }
                    | Refusal::Busy { .. }
            ),
            _ => false,
        }
    }
}

fn connect_advice(address: &str, source: &std::io::Error) -> &'static str {
    let is_serial = address.starts_with("serial:");
    match source.kind() {
        ErrorKind::ConnectionRefused => {
            "nothing listens there. Is it running, and is the port right?"
        }
        ErrorKind::PermissionDenied if is_serial => {
            "you may not open this port. Add yourself to the group it belongs to (often dialout), then log in again"
        }
        ErrorKind::NotFound if is_serial => {
            "there is no such port. Is it plugged in, and under which name does the system list it?"
        }
        ErrorKind::TimedOut | ErrorKind::WouldBlock => {
            "it does not answer. Is the host right, and is no firewall in between?"
        }
        _ if is_serial => "the port cannot be opened. Does another program have it open?",
        _ => "is it running, and is the address right?",
    }
}

/// A device's answer is of another kind than what was asked.
pub(super) fn unexpected(asked: &'static str, reply: &Reply) -> ClientError {
    let found = match reply {
        Reply::Refused(_) => "a refusal",
        Reply::Hello(_) => "an answer to hello",
        Reply::Status(_) => "an answer to status",
        Reply::Measured(_) => "an answer to measure",
        Reply::Receiving { .. } => "an acknowledgement of a blob's bytes",
        Reply::Active(_) => "an answer to an update",
        Reply::Aborted => "an answer to the end of an update",
        Reply::SelfTested(_) => "an answer to the self-test",
    };
    ClientError::BadReply {
        asked,
        found: found.to_owned(),
    }
}
