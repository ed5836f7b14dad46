//! Small files that the user named, read whole.

use super::usage_error::UsageError;
use std::io::ErrorKind;
use std::path::Path;

/// All of a file that the user named.
///
/// # Errors
/// [`UsageError::NotFound`], [`UsageError::Unreadable`].
pub fn read(path: &Path) -> Result<Vec<u8>, UsageError> {
    std::fs::read(path).map_err(|source| match source.kind() {
        ErrorKind::NotFound => UsageError::NotFound {
            path: path.to_owned(),
        },
        _ => UsageError::Unreadable {
            path: path.to_owned(),
            source,
        },
    })
}
