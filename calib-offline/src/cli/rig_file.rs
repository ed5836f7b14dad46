//! A rig from a file: a blob or a calibration, told apart by how the file begins.

use super::error::Error;
use super::input_file::read;
use super::usage_error::UsageError;
use crate::report::Calibration;
use calib_blob::pack::{AlignedBytes, BlobError};
use ray_runtime::RayBlob;
use ray_runtime::format::MAGIC;
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
        let bytes = read(path)?;
        if bytes.starts_with(&MAGIC) {
            return Ok(Self::Blob(AlignedBytes::from(bytes.as_slice())));
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

/// Opens a blob; `path` is for messages only.
///
/// # Errors
/// [`BlobError::Open`].
pub(super) fn open<'a>(bytes: &'a [u8], path: &Path) -> Result<RayBlob<'a>, BlobError> {
    RayBlob::open(bytes).map_err(|source| BlobError::Open {
        file: path.to_owned(),
        source,
    })
}
