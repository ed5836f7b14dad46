//! The board's flash in QEMU: a file that it maps, or memory that starts with one.

use std::io::Write;
use std::path::Path;
use std::process::Stdio;

use tempfile::NamedTempFile;

use super::error::QemuError;
use crate::simulated::flash_file::{FLASH_LENGTH, FlashFile, Kept};
use crate::simulated::sim_flash::Rules;

/// The file that QEMU maps as the board's flash.
#[derive(Debug)]
pub enum Backing {
    Kept(Kept),
    Forgotten(NamedTempFile),
}

impl Backing {
    pub fn of(FlashFile { flash, kept_in }: FlashFile) -> std::io::Result<Self> {
        if flash.rules() != Rules::default() {
            let message = format!(
                "the flash in QEMU has the rules {}, and that of the file {}: name another file, or run it on the host",
                Rules::default(),
                flash.rules()
            );
            return Err(std::io::Error::new(
                std::io::ErrorKind::InvalidInput,
                message,
            ));
        }
        if let Some(kept) = kept_in {
            return Ok(Self::Kept(kept));
        }
        let mut file = NamedTempFile::new()?;
        file.write_all(flash.contents())?;
        Ok(Self::Forgotten(file))
    }

    /// For QEMU as its standard output, to which it writes nothing: a copy of the lock, so that the
    /// file stays locked until QEMU has ended, should this process be killed.
    pub fn lock(&self) -> std::io::Result<Stdio> {
        match self {
            Self::Kept(kept) => Ok(kept.lock.try_clone()?.into()),
            Self::Forgotten(_) => Ok(std::io::stderr().into()),
        }
    }

    pub fn path(&self) -> &Path {
        match self {
            Self::Kept(kept) => &kept.path,
            Self::Forgotten(file) => file.path(),
        }
    }
}

/// What the board's flash is.
pub enum Memory<'a> {
    /// Memory full of zeros.
    Zero,
    /// Behind the program, the contents of this file, for checks that only read.
    StartsWith(&'a Path),
    /// This very file, of the flash's length: what the device writes is in it at once.
    File(&'a Path),
}

impl Memory<'_> {
    /// What to start QEMU's `machine` with, which loads what an image reads at `stored_at`.
    pub fn arguments(&self, machine: &str, stored_at: u32) -> Result<Vec<String>, QemuError> {
        let mut arguments = Vec::new();
        if let Self::File(path) = self {
            let (file, size) = (in_option(path), FLASH_LENGTH);
            arguments.push("-object".to_owned());
            arguments.push(format!(
                "memory-backend-file,id=flash,size={size},mem-path={file},share=on"
            ));
            // What QEMU takes for this board's main memory is the PSRAM that stands for the flash.
            arguments.push("-machine".to_owned());
            arguments.push(format!("{machine},memory-backend=flash"));
            return Ok(arguments);
        }
        arguments.push("-machine".to_owned());
        arguments.push(machine.to_owned());
        if let Self::StartsWith(path) = self
            && length_of(path)? > 0
        {
            let file = in_option(path);
            arguments.push("-device".to_owned());
            arguments.push(format!(
                "loader,file={file},addr={stored_at:#x},force-raw=on"
            ));
        }
        Ok(arguments)
    }
}

/// In QEMU's options a comma ends a value unless it is doubled.
fn in_option(path: &Path) -> String {
    path.display().to_string().replace(',', ",,")
}

/// Length of the contents for a flash. The file is opened as well as measured, so that one that cannot
/// be read is found out here and not by QEMU.
fn length_of(path: &Path) -> Result<u64, QemuError> {
    let unreadable = |source| QemuError::Io {
        what: format!("the flash file {}", path.display()),
        source,
    };
    let length = std::fs::File::open(path)
        .and_then(|file| file.metadata())
        .map_err(unreadable)?
        .len();
    if length > FLASH_LENGTH as u64 {
        return Err(QemuError::FlashTooLong {
            path: path.to_owned(),
            length,
        });
    }
    Ok(length)
}
