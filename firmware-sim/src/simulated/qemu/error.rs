//! Why there is no device in QEMU.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitStatus;

use thiserror::Error;

use crate::client::ClientError;
use crate::simulated::flash_file::{FLASH_LENGTH, FlashFileError};

/// Why there is no device in QEMU.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum QemuError {
    /// QEMU is not installed.
    #[error(
        "{program} is not installed: apt-get install {}, or run scripts/install-embedded.sh",
        package(program)
    )]
    NotInstalled {
        /// Which of its programs.
        program: String,
    },
    /// The sources of the image are not where this program was built.
    #[error("no sources for the image at {}: run from a checkout, or give an image with --image", path.display())]
    NoSources {
        /// The folder looked for.
        path: PathBuf,
    },
    /// An image could not be built.
    #[error("`{image}` could not be built ({status}): see the messages above")]
    Build {
        /// Its name, or their names.
        image: String,
        /// How the build ended.
        status: ExitStatus,
    },
    /// A program could not be started, or a file not be read.
    #[error("{what}")]
    Io {
        /// Program or file.
        what: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file cannot be the device's flash.
    #[error(transparent)]
    FlashFile(#[from] FlashFileError),
    /// The contents for the flash are too long.
    #[error("{} has {length} bytes, and the flash only {FLASH_LENGTH}", path.display())]
    FlashTooLong {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        length: u64,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {address}")]
    Listen {
        /// As given.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// QEMU ended before the device answered.
    #[error("QEMU ended before the device answered ({status}): see its message above")]
    Ended {
        /// How.
        status: ExitStatus,
    },
    /// The device did not answer.
    #[error("QEMU runs, but the device in it does not answer")]
    Silent(#[source] ClientError),
}

/// Debian's package of one of QEMU's programs.
fn package(program: &str) -> &str {
    if program == "qemu-system-riscv32" {
        "qemu-system-misc"
    } else {
        program
    }
}
