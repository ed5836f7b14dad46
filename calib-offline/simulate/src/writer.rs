//! Files in one folder, and how many bytes they have.

use super::error::SimulateError;
use std::path::PathBuf;

/// Writes files into one folder and counts their bytes.
pub(super) struct Writer {
    pub folder: PathBuf,
    pub byte_count: u64,
}

impl Writer {
    pub fn text(&mut self, name: &str, text: &str) -> Result<(), SimulateError> {
        let path = self.folder.join(name);
        std::fs::write(&path, text).map_err(|source| SimulateError::Io { path, source })?;
        self.byte_count += text.len() as u64;
        Ok(())
    }

    pub fn subfolder(&self, name: &str) -> Result<(), SimulateError> {
        let path = self.folder.join(name);
        std::fs::create_dir_all(&path).map_err(|source| SimulateError::Io { path, source })
    }
}
