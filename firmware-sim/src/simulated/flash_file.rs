//! The file that a simulated device keeps its flash in: an image of all of it, the same for the
//! device on the host and the one in QEMU. Behind it, where the flash has other rules than the default, stand
//! those, and for each unit a bit that says whether it was programmed.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use ray_runtime::RayBlob;
use thiserror::Error;

use crate::simulated::sim_flash::{Rules, SimFlash};
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
    /// The flash is too short for its rules.
    #[error(
        "a flash of {FLASH_LENGTH} bytes has no room for two slots by the rules {rules}: give smaller blocks"
    )]
    Rules {
        /// The rules.
        rules: Rules,
    },
    /// The file is of a flash with other rules.
    #[error(
        "the flash file {} was made with the rules {found}, not {given}: leave --flash-rules out, or name another file",
        path.display()
    )]
    OtherRules {
        /// The file.
        path: PathBuf,
        /// Its rules.
        found: Rules,
        /// Those given.
        given: Rules,
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
    blank_with(Rules::default(), own)
}

/// The same with these rules.
///
/// # Errors
/// [`FlashFileError::Rig`], [`FlashFileError::Rules`].
pub fn blank_with(rules: Rules, own: Option<&Rig>) -> Result<SimFlash, FlashFileError> {
    let flash = SimFlash::blank_with(rules, FLASH_LENGTH, 0);
    let mut flash = flash.ok_or(FlashFileError::Rules { rules })?;
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
    holding_with(Rules::default(), blob, own)
}

fn holding_with(rules: Rules, blob: &[u8], own: Option<&Rig>) -> Result<SimFlash, FlashFileError> {
    let mut flash = blank_with(rules, own)?;
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
        Self::open_with(path, None, own)
    }

    /// The same with these rules, if any are given: those of a file that exists must be the same.
    ///
    /// # Errors
    /// [`FlashFileError`].
    pub fn open_with(
        path: &Path,
        given: Option<Rules>,
        own: Option<&Rig>,
    ) -> Result<Self, FlashFileError> {
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
            let flash = holding_with(given.unwrap_or_default(), &contents, own)?;
            return Ok(Self::in_memory(flash));
        }
        let unknown = |length| FlashFileError::Unknown {
            path: path.to_owned(),
            length,
        };
        if !contents.is_empty() && Stored::read(&contents).is_none() {
            return Err(unknown(contents.len()));
        }
        let locked = File::open(path).map_err(failed)?;
        lock(&locked, path)?;
        let mut options = OpenOptions::new();
        let mut file = options.read(true).write(true).open(path).map_err(failed)?;
        // Once more, now that nobody else can be writing.
        contents.clear();
        file.read_to_end(&mut contents).map_err(failed)?;
        let mut flash = if contents.is_empty() {
            let flash = blank_with(given.unwrap_or_default(), own)?;
            file.seek(SeekFrom::Start(0)).map_err(failed)?;
            file.write_all(flash.contents()).map_err(failed)?;
            if flash.rules() != Rules::default() {
                file.write_all(&rules_line(flash.rules())).map_err(failed)?;
                file.write_all(&flash.programmed()).map_err(failed)?;
            }
            flash
        } else if own.is_some() {
            return Err(FlashFileError::RigIsSet {
                path: path.to_owned(),
            });
        } else {
            let Stored {
                rules,
                image,
                programmed,
            } = Stored::read(&contents).ok_or_else(|| unknown(contents.len()))?;
            if let Some(given) = given
                && given != rules
            {
                return Err(FlashFileError::OtherRules {
                    path: path.to_owned(),
                    found: rules,
                    given,
                });
            }
            SimFlash::with(rules, image, programmed, 0).ok_or_else(|| unknown(contents.len()))?
        };
        let has_rules = flash.rules() != Rules::default();
        flash.write_through(file, has_rules.then_some(PROGRAMMED_AT as u64));
        Ok(Self {
            flash,
            kept_in: Some(Kept {
                path: path.to_owned(),
                lock: locked,
            }),
        })
    }
}

/// How the line behind an image begins that says its rules.
const RULES_MAGIC: &str = "flash rules ";

/// Length of that line, bytes.
const RULES_LENGTH: usize = 256;

/// Where the bits of the units stand behind it.
const PROGRAMMED_AT: usize = FLASH_LENGTH + RULES_LENGTH;

fn rules_line(rules: Rules) -> Vec<u8> {
    let text = format!("{RULES_MAGIC}{rules}");
    format!("{text:<width$}\n", width = RULES_LENGTH - 1).into_bytes()
}

/// What a file holds.
struct Stored<'a> {
    rules: Rules,
    image: &'a [u8],
    programmed: Option<&'a [u8]>,
}

impl<'a> Stored<'a> {
    fn read(contents: &'a [u8]) -> Option<Self> {
        let (image, rest) = contents.split_at_checked(FLASH_LENGTH)?;
        if rest.is_empty() {
            return Some(Self {
                rules: Rules::default(),
                image,
                programmed: None,
            });
        }
        let (line, programmed) = rest.split_at_checked(RULES_LENGTH)?;
        let line = str::from_utf8(line).ok()?.trim_end();
        let rules: Rules = line.strip_prefix(RULES_MAGIC)?.parse().ok()?;
        let units = FLASH_LENGTH / rules.unit as usize;
        (programmed.len() == units.div_ceil(8)).then_some(Self {
            rules,
            image,
            programmed: Some(programmed),
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
