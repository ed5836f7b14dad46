//! Keys as the verbs read them.

use super::error::Error;
use super::input_file::read;
use super::usage_error::UsageError;
use firmware_sim::owner::{KeyError, OwnerKey, public_key};
use ray_device::storage::trust::PublicKey;
use std::path::Path;

/// The private key in this file.
///
/// # Errors
/// [`Error::Usage`] if it cannot be read, or holds none.
pub(super) fn private(path: &Path) -> Result<OwnerKey, Error> {
    let text = read(path)?;
    OwnerKey::from_pem(&String::from_utf8_lossy(&text)).map_err(|source| bad(path, source))
}

/// The public key of these digits, or in the file of this name.
///
/// # Errors
/// As [`private`].
pub(super) fn public(text: &str) -> Result<PublicKey, Error> {
    if let Ok(key) = public_key(text) {
        return Ok(key);
    }
    let path = Path::new(text);
    let text = read(path)?;
    public_key(&String::from_utf8_lossy(&text)).map_err(|source| bad(path, source))
}

fn bad(path: &Path, source: KeyError) -> Error {
    Error::Usage(UsageError::Key {
        path: path.to_owned(),
        source,
    })
}
