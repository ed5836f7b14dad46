//! A rig from a file: a blob or a calibration, told apart by how the file begins.

use crate::error::{BlobError, Error, UsageError};
use crate::report::Calibration;
use ray_runtime::RayBlob;
use ray_runtime::format::{ALIGNMENT, MAGIC};
use std::path::Path;

/// What a file of a rig holds.
#[derive(Debug)]
pub(super) enum RigFile {
    /// A blob, still closed.
    Blob(AlignedBytes),
    /// A calibration.
    Calibration(Box<Calibration>),
}

impl RigFile {
    /// Reads the file.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is neither, else that of its kind.
    pub fn read(path: &Path) -> Result<Self, Error> {
        if !path.exists() {
            return Err(Error::Usage(UsageError::NotFound {
                path: path.to_owned(),
            }));
        }
        let bytes = std::fs::read(path).map_err(|source| BlobError::Read {
            file: path.to_owned(),
            source,
        })?;
        if bytes.starts_with(&MAGIC) {
            return Ok(Self::Blob(AlignedBytes::new(&bytes)));
        }
        let first = bytes.iter().find(|b| !b.is_ascii_whitespace());
        if first == Some(&b'{') {
            let calibration = Calibration::from_json(path, &bytes)?;
            return Ok(Self::Calibration(Box::new(calibration)));
        }
        Err(Error::Usage(UsageError::UnknownKind {
            path: path.to_owned(),
            expected: "a blob (it would begin with RAYS) or a calibration.json (it would begin with {)",
        }))
    }
}

/// Bytes at an address that a blob may be opened at.
#[derive(Debug)]
pub(super) struct AlignedBytes {
    words: Vec<u64>,
    len: usize,
}

impl AlignedBytes {
    fn new(bytes: &[u8]) -> Self {
        let mut words = vec![0u64; bytes.len().div_ceil(ALIGNMENT)];
        bytemuck::cast_slice_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self {
            words,
            len: bytes.len(),
        }
    }

    /// Opens the blob; `path` is for messages only.
    ///
    /// # Errors
    /// [`BlobError::Open`].
    pub fn open(&self, path: &Path) -> Result<RayBlob<'_>, BlobError> {
        RayBlob::open(&bytemuck::cast_slice(&self.words)[..self.len]).map_err(|source| {
            BlobError::Open {
                file: path.to_owned(),
                source,
            }
        })
    }
}
