//! Signatures as they travel and are stored.

use serde::{Deserialize, Serialize};

/// An Ed25519 signature (RFC 8032).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Signature {
    /// Its first half, a point.
    pub r: [u8; 32],
    /// Its second half, a number.
    pub s: [u8; 32],
}

impl Signature {
    /// From its 64 bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (r, s) = bytes.split_first_chunk()?;
        Some(Self {
            r: *r,
            s: s.try_into().ok()?,
        })
    }
}
