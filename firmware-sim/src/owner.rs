//! What the owner of a device does: keeps a key, signs manifests and orders.
//!
//! # Example
//! ```
//! use firmware_sim::owner::{OwnerKey, Terms, manifest_of};
//!
//! let blob = std::fs::read("../data/golden/stereo-v3-small.rays")?;
//! let key = OwnerKey::generate()?;
//! let manifest = manifest_of(&blob, &Terms { version: 1, ..Terms::default() })?;
//! let file = key.sign_manifest(&manifest);
//! assert_eq!(file.len(), 168);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod key_file;

use ray_device::frame::checksum;
use ray_device::manifest::{Manifest, ManifestBytes, OrderText, root};
use ray_device::protocol::{MAX_NAME, Order, name};
use ray_runtime::OpenError;
use thiserror::Error;

use crate::ask_blob::ask_blob;

pub use key_file::{KeyError, OwnerKey, public_key, public_pem};

/// What an owner decides about a blob.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Terms {
    /// Of this blob: above that of every blob before.
    pub version: u32,
    /// The least version that devices may still use.
    pub least_version: u32,
    /// Number of the key that signs.
    pub key: u8,
    /// Keys with a lower number are retired.
    pub least_key: u8,
    /// Serial number of the one rig that it is for; `None` for any.
    pub rig_serial: Option<String>,
}

/// Why there is no manifest.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ManifestError {
    /// There is nothing to sign.
    #[error("this is no blob that a device could use: {0}")]
    NotABlob(OpenError),
    /// A version that no device could take.
    #[error(
        "version {version} with least version {least}: versions count from 1, and none may rule itself out"
    )]
    Version {
        /// As given.
        version: u32,
        /// As given.
        least: u32,
    },
    /// A key that there is not, or that would retire itself.
    #[error(
        "key number {key} with keys below {least} retired: a device has keys 0 and 1, and none may retire itself"
    )]
    Key {
        /// As given.
        key: u8,
        /// As given.
        least: u8,
    },
    /// A serial number that no device has.
    #[error("the serial number {serial:?} has no or more than {MAX_NAME} bytes")]
    Serial {
        /// As given.
        serial: String,
    },
}

/// The manifest of a blob, to be signed.
///
/// # Errors
/// [`ManifestError`].
pub fn manifest_of(blob: &[u8], terms: &Terms) -> Result<Manifest, ManifestError> {
    let identity = ask_blob(blob, |blob| *blob.identity()).map_err(ManifestError::NotABlob)?;
    if terms.version == 0 || terms.least_version > terms.version {
        return Err(ManifestError::Version {
            version: terms.version,
            least: terms.least_version,
        });
    }
    if let Some(serial) = &terms.rig_serial
        && (serial.is_empty() || serial.len() > MAX_NAME)
    {
        let serial = serial.clone();
        return Err(ManifestError::Serial { serial });
    }
    let manifest = Manifest {
        key: terms.key,
        least_key: terms.least_key,
        version: terms.version,
        least_version: terms.least_version,
        length: u32::try_from(blob.len()).unwrap_or(u32::MAX),
        checksum: checksum(blob),
        identity,
        rig_serial: terms.rig_serial.as_deref().map(name),
        root: root(blob, || ()),
    };
    manifest.check().map_err(|_| ManifestError::Key {
        key: terms.key,
        least: terms.least_key,
    })?;
    Ok(manifest)
}

impl OwnerKey {
    /// The manifest with its signature: what is stored in a file and sent to a device.
    pub fn sign_manifest(&self, manifest: &Manifest) -> ManifestBytes {
        manifest.to_bytes(&self.sign(&manifest.to_be_signed()))
    }

    /// An order with its signature.
    pub fn sign_order(&self, text: &OrderText<'_>) -> Order {
        Order {
            action: text.action,
            key: text.key,
            sequence: text.sequence,
            signature: self.sign(&text.to_be_signed()),
        }
    }
}
