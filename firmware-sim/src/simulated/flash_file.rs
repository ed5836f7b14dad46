//! The file that a simulated device keeps its flash in: an image of all of it, the same for the
//! device on the host and the one in QEMU.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use ray_runtime::RayBlob;
use thiserror::Error;

use crate::simulated::sim_flash::{BLOCK, SimFlash};
use ray_device::frame::checksum;
use ray_device::port::NoClock;
use ray_device::protocol::Rig;
use ray_device::storage::log::Log;
use ray_device::storage::record::Record;
use ray_device::storage::slot::SlotFlash;
use ray_device::storage::{program_blob, rig};

/// Size of a device's flash, bytes: that of the board which QEMU emulates.
pub const FLASH_LENGTH: usize = 16 << 20;

/// Why a file cannot be a device's flash.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FlashFileError {
    /// The file cannot be opened, read or written.
    #[error("the flash file {}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is neither an image nor a blob.
    #[error(
        "{} has {length} bytes: it is neither the image of a flash, which has {FLASH_LENGTH}, nor a blob. Name a file that does not exist yet to start with an empty flash",
        path.display()
    )]
    Unknown {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        length: usize,
    },
    /// Another device has it.
    #[error("the flash file {} is in use by another device: give each a file of its own", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The device's cameras are set when its flash is made.
    #[error(
        "the flash file {} exists, and its device's cameras were set when it was made: leave --camera and --serial out, or name another file",
        path.display()
    )]
    RigIsSet {
        /// The file.
        path: PathBuf,
    },
    /// The blob does not fit a slot.
    #[error("a blob of {length} bytes does not fit a slot of the flash, {limit} bytes")]
    TooLong {
        /// Of the blob, bytes.
        length: usize,
        /// Of a slot, bytes.
        limit: usize,
    },
    /// The record of the device's cameras could not be written.
    #[error("the record of the device's cameras could not be written")]
    Rig,
}

/// A flash, and what is to be known of its file.
#[derive(Debug)]
pub struct FlashFile {
    /// The flash; it writes to its file whatever changes, unless that is a plain blob.
    pub flash: SimFlash,
    /// The file, locked for as long as this lives; `None` if nothing is kept.
    pub kept_in: Option<Kept>,
}

/// A file that a flash is kept in.
#[derive(Debug)]
pub struct Kept {
    /// Where it is.
    pub path: PathBuf,
    /// Holds the lock for as long as it, or a copy of it in another process, is open. Read-only.
    pub(crate) lock: File,
}

/// An empty flash in memory that knows these cameras.
///
/// # Errors
/// [`FlashFileError::Rig`].
pub fn blank(own: Option<&Rig>) -> Result<SimFlash, FlashFileError> {
    let flash = SimFlash::blank(FLASH_LENGTH / BLOCK, 0);
    let mut flash = flash.ok_or(FlashFileError::Rig)?;
    if let Some(own) = own {
        rig::write(&mut flash.regions().factory, own, &mut NoClock)
            .map_err(|_| FlashFileError::Rig)?;
    }
    Ok(flash)
}

/// A flash in memory with these bytes as the blob of its first slot, unchecked, as if they had been
/// put there when the device was made. What follows the length that a blob states is left out.
///
/// # Errors
/// [`FlashFileError::TooLong`].
pub fn holding(blob: &[u8], own: Option<&Rig>) -> Result<SimFlash, FlashFileError> {
    let mut flash = blank(own)?;
    let stated = RayBlob::stated_len(blob).map_or(blob.len(), |length| length as usize);
    let blob = blob.get(..stated).unwrap_or(blob);
    if blob.is_empty() {
        return Ok(flash);
    }
    let [slot, _] = &mut flash.regions().slots;
    let limit = slot.max_blob(0) as usize;
    let too_long = FlashFileError::TooLong {
        length: blob.len(),
        limit,
    };
    if blob.len() > limit {
        return Err(too_long);
    }
    let record = Record {
        sequence: 1,
        length: blob.len() as u32,
        checksum: checksum(blob),
        ..Record::default()
    };
    program_blob(slot, 0, blob, &mut NoClock)
        .and_then(|()| Log::commit(slot, &record, &mut NoClock))
        .map_err(|_| too_long)?;
    Ok(flash)
}

impl FlashFile {
    /// A flash that is forgotten when its device stops.
    pub fn in_memory(flash: SimFlash) -> Self {
        Self {
            flash,
            kept_in: None,
        }
    }

    /// Opens the flash in `path`. One that does not exist, or is empty, is made, blank but for the
    /// record of the device's own cameras. A plain blob is left as it is: the device starts with it in
    /// a flash in memory.
    ///
    /// # Errors
    /// [`FlashFileError`].
    pub fn open(path: &Path, own: Option<&Rig>) -> Result<Self, FlashFileError> {
        let failed = |source| FlashFileError::Io {
            path: path.to_owned(),
            source,
        };
        if !path.exists() {
            make(path).map_err(failed)?;
        }
        let mut file = File::open(path).map_err(failed)?;
        let mut contents = Vec::new();
        file.read_to_end(&mut contents).map_err(failed)?;
        if contents.starts_with(&ray_runtime::format::MAGIC) {
            let flash = holding(&contents, own)?;
            return Ok(Self::in_memory(flash));
        }
        if !matches!(contents.len(), 0 | FLASH_LENGTH) {
            return Err(FlashFileError::Unknown {
                path: path.to_owned(),
                length: contents.len(),
            });
        }
        let locked = File::open(path).map_err(failed)?;
        lock(&locked, path)?;
        let mut options = OpenOptions::new();
        let mut file = options.read(true).write(true).open(path).map_err(failed)?;
        // Once more, now that nobody else can be writing.
        contents.clear();
        file.read_to_end(&mut contents).map_err(failed)?;
        let mut flash = if contents.is_empty() {
            let flash = blank(own)?;
            file.seek(SeekFrom::Start(0)).map_err(failed)?;
            file.write_all(flash.contents()).map_err(failed)?;
            flash
        } else if own.is_some() {
            return Err(FlashFileError::RigIsSet {
                path: path.to_owned(),
            });
        } else {
            SimFlash::with_contents(&contents, 0).ok_or(FlashFileError::Unknown {
                path: path.to_owned(),
                length: contents.len(),
            })?
        };
        flash.write_through(file);
        Ok(Self {
            flash,
            kept_in: Some(Kept {
                path: path.to_owned(),
                lock: locked,
            }),
        })
    }
}

/// An empty file, unless there is one by now.
fn make(path: &Path) -> std::io::Result<()> {
    match OpenOptions::new().write(true).create_new(true).open(path) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => Err(error),
        _ => Ok(()),
    }
}

/// How long the device before, which may have been killed just now, is given to end.
const LOCK_PATIENCE: Duration = Duration::from_secs(1);

fn lock(file: &File, path: &Path) -> Result<(), FlashFileError> {
    let deadline = Instant::now() + LOCK_PATIENCE;
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(()),
            Err(TryLockError::WouldBlock) if Instant::now() < deadline => {
                thread::sleep(Duration::from_millis(20));
            }
            Err(TryLockError::WouldBlock) => {
                return Err(FlashFileError::InUse {
                    path: path.to_owned(),
                });
            }
            Err(TryLockError::Error(source)) => {
                return Err(FlashFileError::Io {
                    path: path.to_owned(),
                    source,
                });
            }
        }
    }
}
