//! Who may change a device: anybody, or the owner of one or two keys.
//!
//! A device with an owner takes a blob only with a [`Manifest`] that the owner signed, and rolls back or
//! gives an update up only on an order that the owner signed, or on a local call. Signatures are Ed25519
//! (RFC 8032), verified strictly: no second signature of the same bytes passes. The keys are fixed when
//! the device is built.
//!
//! # Versions
//! What a device has seen signed is written into each commit record as its [`Claims`]. They never go
//! back, with one exception: the first manifest of a key that retires the one before begins the count of
//! versions anew, so that a stolen key cannot use the numbers up.

mod keys;

use crate::manifest::{Link, Malformed, Manifest};
use crate::protocol::{NewBlob, Refusal, Rig, RigPart, Signature};

pub use crate::protocol::{Claims, Distrust, KeyId};
pub use keys::Keys;
#[cfg(feature = "signed")]
pub use keys::PublicKey;

/// Who may change a device.
#[derive(Clone, Copy, Debug, Default)]
pub enum Trust {
    /// Anybody.
    #[default]
    Anybody,
    /// The owner of these keys.
    Owner(Keys),
}

impl Claims {
    /// What they become with the blob of this manifest.
    pub fn after(self, manifest: &Manifest) -> Self {
        if self.is_succeeded_by(manifest) {
            return Self {
                newest_version: manifest.version,
                least_version: manifest.least_version,
                least_key: manifest.least_key.into(),
            };
        }
        Self {
            newest_version: self.newest_version.max(manifest.version),
            least_version: self.least_version.max(manifest.least_version),
            least_key: self.least_key.max(manifest.least_key.into()),
        }
    }

    /// What two records say together: those of the later key; of one key, the higher of each.
    pub fn joined(self, other: Self) -> Self {
        match self.least_key.cmp(&other.least_key) {
            core::cmp::Ordering::Greater => self,
            core::cmp::Ordering::Less => other,
            core::cmp::Ordering::Equal => Self {
                newest_version: self.newest_version.max(other.newest_version),
                least_version: self.least_version.max(other.least_version),
                least_key: self.least_key,
            },
        }
    }

    /// Whether these come after the others: of a later key, or of one key with a newer version.
    pub fn is_newer_than(self, other: Self) -> bool {
        (self.least_key, self.newest_version) > (other.least_key, other.newest_version)
    }

    /// Whether this manifest retires a key whose versions therefore no longer count.
    fn is_succeeded_by(self, manifest: &Manifest) -> bool {
        u32::from(manifest.least_key) > self.least_key
    }

    /// Whether the blob of this manifest may be in use.
    ///
    /// # Errors
    /// [`Refusal::KeyRetired`], [`Refusal::VersionTooOld`].
    pub fn check_use(self, manifest: &Manifest) -> Result<(), Refusal> {
        if u32::from(manifest.key) < self.least_key {
            return Err(Refusal::KeyRetired { key: manifest.key });
        }
        if !self.is_succeeded_by(manifest) && manifest.version < self.least_version {
            return Err(Refusal::VersionTooOld {
                version: manifest.version,
                least: self.least_version,
            });
        }
        Ok(())
    }

    /// Whether the blob that the device was made with, which has no manifest, may be in use: as version 0.
    ///
    /// # Errors
    /// [`Refusal::VersionTooOld`].
    pub fn check_factory(self) -> Result<(), Refusal> {
        if self.least_version == 0 {
            return Ok(());
        }
        Err(Refusal::VersionTooOld {
            version: 0,
            least: self.least_version,
        })
    }

    /// Whether the blob of this manifest may be stored, beside what the slots hold whole: a newer one,
    /// or the newest one where it has been lost.
    ///
    /// # Errors
    /// As [`Claims::check_use`].
    pub fn check_update(
        self,
        manifest: &Manifest,
        held: impl IntoIterator<Item = u32>,
    ) -> Result<(), Refusal> {
        self.check_use(manifest)?;
        if self.is_succeeded_by(manifest) || manifest.version > self.newest_version {
            return Ok(());
        }
        let is_lost = !held.into_iter().any(|version| version == manifest.version);
        if manifest.version == self.newest_version && is_lost {
            return Ok(());
        }
        Err(Refusal::VersionTooOld {
            version: manifest.version,
            least: self.newest_version.saturating_add(1),
        })
    }
}

impl Trust {
    /// Whether the device has an owner, whose signature is then needed.
    pub const fn needs_signature(&self) -> bool {
        matches!(self, Self::Owner(_))
    }

    /// The owner's keys.
    pub const fn keys(&self) -> Option<Keys> {
        match self {
            Self::Anybody => None,
            Self::Owner(keys) => Some(*keys),
        }
    }
}

/// Reads a manifest that is not verified yet.
///
/// # Errors
/// [`Refusal::NotSigned`] without one, [`Refusal::BadManifest`].
pub fn read(bytes: &[u8]) -> Result<(Manifest, Signature), Refusal> {
    if bytes.is_empty() {
        return Err(Refusal::NotSigned);
    }
    Manifest::parse(bytes).map_err(|malformed| {
        let format = match malformed {
            Malformed::NotOne => 0,
            Malformed::Format { found } => found,
            Malformed::Contents => 1,
        };
        Refusal::BadManifest { format }
    })
}

/// What is for a rig of another serial number.
pub(crate) const OTHER_SERIAL: Refusal = Refusal::OtherRig {
    camera: 0,
    what: RigPart::Serial,
    expected: 0,
    found: 0,
};

/// Whether a manifest is of the blob that was announced, and for this rig.
///
/// # Errors
/// [`Refusal::OtherManifest`], [`Refusal::OtherRig`].
pub fn check_fit(manifest: &Manifest, new: &NewBlob, rig: Option<&Rig>) -> Result<(), Refusal> {
    if (manifest.length, manifest.checksum, manifest.identity)
        != (new.length, new.checksum, new.identity)
    {
        return Err(Refusal::OtherManifest);
    }
    check_rig(manifest, rig)
}

/// Whether a manifest is for this rig. One for a single rig fits no device that does not know its own.
///
/// # Errors
/// [`Refusal::OtherRig`].
pub fn check_rig(manifest: &Manifest, rig: Option<&Rig>) -> Result<(), Refusal> {
    match &manifest.rig_serial {
        Some(serial) if rig.is_none_or(|own| own.serial != *serial) => Err(OTHER_SERIAL),
        _ => Ok(()),
    }
}

/// A manifest of which the signature has been verified, and what is expected of the next chunk.
#[derive(Clone, Debug)]
pub struct Verified {
    /// Whose it is.
    pub keys: Keys,
    /// Its version.
    pub version: u32,
    /// What the device claims once the blob is in use.
    pub claims: Claims,
    /// Link of the piece that comes next.
    pub expected: Link,
}

#[cfg(test)]
mod tests;
