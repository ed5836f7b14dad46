//! What travels between a device and its owner, besides signed blobs: orders, and what it has seen signed.

use serde::{Deserialize, Serialize};

use crate::manifest::{Action, MAX_KEYS, Signature};

/// What the owner of a device orders: the signature is of an [`OrderText`](crate::manifest::OrderText).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Order {
    /// What is to be done.
    pub action: Action,
    /// Number of the key that signed it.
    pub key: u8,
    /// Sequence number of the blob that was active when it was signed; 0 if there was none.
    pub sequence: u32,
    /// Of the order's text.
    pub signature: Signature,
}

/// What a device with an owner tells of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OwnerStatus {
    /// The first bytes of its public keys.
    pub keys: [Option<KeyId>; MAX_KEYS],
    /// What it has seen signed.
    pub claims: Claims,
}

/// What a device has seen signed; all 0 without an owner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Claims {
    /// The highest version that was ever in use.
    pub newest_version: u32,
    /// No blob of a lower version is used.
    pub least_version: u32,
    /// Keys with a lower number are retired.
    pub least_key: u32,
}

/// What of a key a device shows: its first bytes.
pub type KeyId = [u8; 8];
