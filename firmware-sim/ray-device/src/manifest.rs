//! Manifests and orders: what the owner of a device signs, byte by byte.
//!
//! All numbers are little endian. A manifest says which blob it is for, and travels and is stored as
//! [`MANIFEST_LENGTH`] bytes:
//!
//! ```text
//!   0  magic "RayM"
//!   4  format u8: 1
//!   5  number of the key that signed u8: 0 or 1
//!   6  least_key u8: keys with a lower number are retired
//!   7  length of the rig's serial number u8, 0 to 32; 255: for any rig
//!   8  version u32, from 1
//!  12  least_version u32: no blob below it is used any more
//!  16  length of the blob u32, bytes
//!  20  CRC-32 of all its bytes u32 (zlib's)
//!  24  identity of the blob [u8; 16]
//!  40  serial number of the rig, UTF-8, filled up with zeros [u8; 32]
//!  72  root of the chain over the blob's pieces [u8; 32]
//! 104  Ed25519 signature (RFC 8032) of "ray-device manifest" filled up with zeros to 24 bytes, then
//!      the 104 bytes above [u8; 64]
//! ```
//! # The chain
//! The blob is cut into pieces of [`PIECE_LENGTH`] bytes, the last of which may be shorter. The link of
//! a piece is the first 32 bytes of SHA-512(piece | link of the next piece), where 32 zeros stand
//! behind the last piece; the root is the link of the first one. A chunk of a signed update is one
//! piece and carries the link of the next: the device checks each against what it expects before
//! it stores a byte, so nobody but the owner chooses any of them.
//!
//! # Orders
//! To roll a device back, or to give an update up, the owner signs "ray-device order" filled up with
//! zeros to 24 bytes, then [`ORDER_LENGTH`] bytes:
//! ```text
//!   0  what u8: 1 roll back, 2 give the update up
//!   1  number of the key that signed u8
//!   2  length of the device's serial number u8, 0 if it has none
//!   3  0
//!   4  sequence number of the active blob u32, 0 if there is none
//!   8  number of the update since the device started u32; 0 to roll back
//!  12  CRC-32 of the blob that is meant u32: the active one to roll back, 0 if there is none, else
//!      the one under way
//!  16  serial number of the device, UTF-8, filled up with zeros [u8; 32]
//! ```
//! A rollback changes the sequence number and an abort ends the update, so an order works once, and on one
//! device.

mod signature;

use ray_runtime::format::IDENTITY_LEN;

use crate::protocol::{MAX_NAME, Name, name};

pub use signature::Signature;

/// Length of a manifest with its signature, bytes.
pub const MANIFEST_LENGTH: usize = BODY_LENGTH + SIGNATURE_LENGTH;

/// Length of what is signed of a manifest, its domain included, bytes.
pub const SIGNED_LENGTH: usize = DOMAIN_LENGTH + BODY_LENGTH;

/// Length of an order without its domain, bytes.
pub const ORDER_LENGTH: usize = 16 + MAX_NAME;

/// Length of what is signed of an order, its domain included, bytes.
pub const SIGNED_ORDER_LENGTH: usize = DOMAIN_LENGTH + ORDER_LENGTH;

/// Length of a piece of a blob, bytes.
pub const PIECE_LENGTH: usize = 512;

/// Length of a link of the chain, bytes.
pub const LINK_LENGTH: usize = 32;

/// A link of the chain over a blob's pieces.
pub type Link = [u8; LINK_LENGTH];

/// What stands in place of the link behind the last piece.
pub const NO_LINK: Link = [0; LINK_LENGTH];

/// Keys of a device at most.
pub const MAX_KEYS: usize = 2;

const DOMAIN_LENGTH: usize = 24;
const BODY_LENGTH: usize = 72 + LINK_LENGTH;
const SIGNATURE_LENGTH: usize = 64;
const MANIFEST_DOMAIN: &[u8; DOMAIN_LENGTH] = b"ray-device manifest\0\0\0\0\0";
const ORDER_DOMAIN: &[u8; DOMAIN_LENGTH] = b"ray-device order\0\0\0\0\0\0\0\0";
const MAGIC: [u8; 4] = *b"RayM";
const FORMAT: u8 = 1;
const ANY_RIG: u8 = 255;

/// A manifest as it travels and is stored.
pub type ManifestBytes = [u8; MANIFEST_LENGTH];

/// What the owner of a device says of a blob.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Manifest {
    /// Number of the key that signs.
    pub key: u8,
    /// Keys with a lower number are retired.
    pub least_key: u8,
    /// Counts up; a device takes no older one.
    pub version: u32,
    /// No blob of a lower version is used any more, not even after a rollback.
    pub least_version: u32,
    /// Length of the blob, bytes.
    pub length: u32,
    /// CRC-32 of all its bytes: [`crate::frame::checksum`].
    pub checksum: u32,
    /// Hash of the calibration that it was packed from.
    pub identity: [u8; IDENTITY_LEN],
    /// Serial number of the one rig that it is for; `None` for any.
    pub rig_serial: Option<Name>,
    /// Root of the chain over its pieces.
    pub root: Link,
}

/// Why bytes are no manifest, or no order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Malformed {
    /// They do not begin as one, or have another length.
    NotOne,
    /// They are of a format that is not known here.
    Format {
        /// The format.
        found: u8,
    },
    /// What they say is impossible: a version of 0 or below its own least version, a key that there is
    /// not or that retires itself, a serial number that is empty or no text.
    Contents,
}

impl Manifest {
    /// Whether what it says can be signed.
    ///
    /// # Errors
    /// [`Malformed::Contents`].
    pub fn check(&self) -> Result<(), Malformed> {
        let is_possible = usize::from(self.key) < MAX_KEYS
            && self.least_key <= self.key
            && self.version > 0
            && self.least_version <= self.version
            && self.rig_serial.as_deref() != Some("");
        is_possible.then_some(()).ok_or(Malformed::Contents)
    }

    /// The bytes that are signed.
    pub fn to_be_signed(&self) -> [u8; SIGNED_LENGTH] {
        let mut bytes = [0; SIGNED_LENGTH];
        fill(&mut bytes, &[MANIFEST_DOMAIN, &self.body()]);
        bytes
    }

    /// The whole manifest.
    pub fn to_bytes(&self, signature: &Signature) -> ManifestBytes {
        let mut bytes = [0; MANIFEST_LENGTH];
        fill(&mut bytes, &[&self.body(), &signature.r, &signature.s]);
        bytes
    }

    fn body(&self) -> [u8; BODY_LENGTH] {
        let (serial_length, serial) = match &self.rig_serial {
            Some(serial) => (serial.len() as u8, serial.as_str()),
            None => (ANY_RIG, ""),
        };
        let head = [FORMAT, self.key, self.least_key, serial_length];
        let [version, least_version, length, checksum] =
            [self.version, self.least_version, self.length, self.checksum].map(u32::to_le_bytes);
        let mut body = [0; BODY_LENGTH];
        fill(
            &mut body,
            &[
                &MAGIC,
                &head,
                &version,
                &least_version,
                &length,
                &checksum,
                &self.identity,
                &padded(serial),
                &self.root,
            ],
        );
        body
    }

    /// Reads one, and the signature that is claimed for it: nothing is verified here.
    ///
    /// # Errors
    /// [`Malformed`].
    pub fn parse(bytes: &[u8]) -> Result<(Self, Signature), Malformed> {
        let bytes = bytes
            .first_chunk()
            .filter(|_| bytes.len() == MANIFEST_LENGTH);
        let bytes: &ManifestBytes = bytes.ok_or(Malformed::NotOne)?;
        let mut reader = Reader(bytes);
        let mut read = || {
            let magic = reader.take()?;
            let head: [u8; 4] = reader.take()?;
            let numbers: [[u8; 4]; 4] = [
                reader.take()?,
                reader.take()?,
                reader.take()?,
                reader.take()?,
            ];
            let identity = reader.take()?;
            let serial: [u8; MAX_NAME] = reader.take()?;
            let root = reader.take()?;
            let (r, s) = (reader.take()?, reader.take()?);
            Some((
                magic,
                head,
                numbers,
                identity,
                serial,
                root,
                Signature { r, s },
            ))
        };
        let (magic, head, numbers, identity, serial, root, signature) =
            read().ok_or(Malformed::NotOne)?;
        let [format, key, least_key, serial_length] = head;
        if magic != MAGIC {
            return Err(Malformed::NotOne);
        }
        if format != FORMAT {
            return Err(Malformed::Format { found: format });
        }
        let rig_serial = match serial_length {
            ANY_RIG => None,
            length => {
                let text = serial.get(..usize::from(length));
                let text = text.and_then(|text| core::str::from_utf8(text).ok());
                Some(name(text.ok_or(Malformed::Contents)?))
            }
        };
        let [version, least_version, length, checksum] = numbers.map(u32::from_le_bytes);
        let manifest = Self {
            key,
            least_key,
            version,
            least_version,
            length,
            checksum,
            identity,
            rig_serial,
            root,
        };
        manifest.check()?;
        // One meaning has one spelling: nothing behind the serial number.
        if padded(manifest.rig_serial.as_deref().unwrap_or_default()) != serial {
            return Err(Malformed::Contents);
        }
        Ok((manifest, signature))
    }
}

/// What an owner may order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Action {
    /// Make the other slot's blob active.
    Rollback,
    /// Give the update up that is under way.
    Abort,
}

/// What an order is for: signed by the owner, and made up anew by the device, so that it fits no other
/// device and no other moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OrderText<'a> {
    /// What is to be done.
    pub action: Action,
    /// Number of the key that signs.
    pub key: u8,
    /// Serial number of the device's rig; empty if it has none.
    pub serial: &'a str,
    /// Sequence number of the active blob; 0 if there is none.
    pub sequence: u32,
    /// Number of the update under way, to give it up; 0 to roll back.
    pub update: u32,
    /// CRC-32 of the blob under way, or to roll back of the active one; 0 if there is none.
    pub checksum: u32,
}

impl OrderText<'_> {
    /// The bytes that are signed.
    pub fn to_be_signed(&self) -> [u8; SIGNED_ORDER_LENGTH] {
        let action = match self.action {
            Action::Rollback => 1,
            Action::Abort => 2,
        };
        let mut bytes = [0; SIGNED_ORDER_LENGTH];
        fill(
            &mut bytes,
            &[
                ORDER_DOMAIN,
                &[action, self.key, self.serial.len() as u8, 0],
                &self.sequence.to_le_bytes(),
                &self.update.to_le_bytes(),
                &self.checksum.to_le_bytes(),
                &padded(self.serial),
            ],
        );
        bytes
    }
}

/// The link of a piece.
#[cfg(feature = "signed")]
pub fn link(piece: &[u8], next: &Link) -> Link {
    use sha2::Digest;
    let hash = sha2::Sha512::new_with_prefix(piece)
        .chain_update(next)
        .finalize();
    let mut link = NO_LINK;
    fill(&mut link, &[&hash]);
    link
}

/// The root of the chain over a blob, calling `step` before each piece. 95 instructions a byte on a
/// Cortex-M4F.
#[cfg(feature = "signed")]
pub fn root(blob: &[u8], mut step: impl FnMut()) -> Link {
    blob.chunks(PIECE_LENGTH)
        .rev()
        .fold(NO_LINK, |next, piece| {
            step();
            link(piece, &next)
        })
}

/// Takes numbers off the front of bytes.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*head)
    }
}

/// The parts, one behind the other, as far as they fit.
fn fill(bytes: &mut [u8], parts: &[&[u8]]) {
    let parts = parts.iter().flat_map(|part| part.iter());
    for (place, &byte) in bytes.iter_mut().zip(parts) {
        *place = byte;
    }
}

fn padded(text: &str) -> [u8; MAX_NAME] {
    let mut bytes = [0; MAX_NAME];
    fill(&mut bytes, &[text.as_bytes()]);
    bytes
}

#[cfg(test)]
mod tests;
