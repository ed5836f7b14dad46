//! The keys that a device verifies signatures with.

use super::{check_rig, read};
use crate::manifest::{Link, MAX_KEYS, Manifest};
use crate::protocol::{Claims, KeyId, Refusal, Rig, Signature};

/// The keys of a device's owner: key 0, and perhaps key 1 for the day on which key 0 is lost.
#[cfg(feature = "signed")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Keys([Option<PublicKey>; MAX_KEYS]);

/// Nothing: without the feature `signed` no device has an owner.
#[cfg(not(feature = "signed"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keys {}

#[cfg(feature = "signed")]
impl Keys {
    /// Key 0 alone.
    pub const fn one(key: PublicKey) -> Self {
        Self([Some(key), None])
    }

    /// Key 0 and key 1.
    pub const fn two(key_0: PublicKey, key_1: PublicKey) -> Self {
        Self([Some(key_0), Some(key_1)])
    }

    /// The keys, by number.
    pub const fn all(&self) -> [Option<PublicKey>; MAX_KEYS] {
        self.0
    }

    /// The first bytes of each key.
    pub fn ids(&self) -> [Option<KeyId>; MAX_KEYS] {
        self.0
            .map(|key| key.and_then(|key| key.0.first_chunk().copied()))
    }

    /// Whether the key of this number signed these bytes.
    ///
    /// # Errors
    /// [`Refusal::NoSuchKey`], [`Refusal::BadSignature`].
    pub fn check(&self, key: u8, signed: &[u8], signature: &Signature) -> Result<(), Refusal> {
        let key = self.0.get(usize::from(key)).copied().flatten();
        let key = key.ok_or(Refusal::NoSuchKey)?;
        key.has_signed(signed, signature)
            .then_some(())
            .ok_or(Refusal::BadSignature)
    }

    /// The link of a piece: [`crate::manifest::link`].
    #[inline(never)]
    pub fn link(&self, piece: &[u8], next: &Link) -> Link {
        crate::manifest::link(piece, next)
    }

    /// The root of the chain over a blob: [`crate::manifest::root`].
    #[inline(never)]
    pub fn root(&self, blob: &[u8], step: &mut dyn FnMut()) -> Link {
        crate::manifest::root(blob, step)
    }
}

#[cfg(not(feature = "signed"))]
#[allow(missing_docs, clippy::missing_errors_doc, clippy::unused_self)]
impl Keys {
    pub fn ids(&self) -> [Option<KeyId>; MAX_KEYS] {
        match *self {}
    }

    pub fn check(&self, _: u8, _: &[u8], _: &Signature) -> Result<(), Refusal> {
        match *self {}
    }

    pub fn link(&self, _: &[u8], _: &Link) -> Link {
        match *self {}
    }

    pub fn root(&self, _: &[u8], _: &mut dyn FnMut()) -> Link {
        match *self {}
    }
}

impl Keys {
    /// Whether the owner signed this manifest.
    ///
    /// # Errors
    /// [`Refusal::NoSuchKey`], [`Refusal::BadSignature`].
    pub fn check_manifest(
        &self,
        manifest: &Manifest,
        signature: &Signature,
    ) -> Result<(), Refusal> {
        self.check(manifest.key, &manifest.to_be_signed(), signature)
    }

    /// Whether a blob in a slot may be used: its stored manifest is the owner's, of these very bytes, for
    /// this rig, and not below what the device claims. 1.8 million instructions on a Cortex-M4F and 95
    /// for each byte of the blob.
    ///
    /// # Errors
    /// Why not, as for an update.
    pub fn check_stored(
        &self,
        manifest: &[u8],
        blob: &[u8],
        rig: Option<&Rig>,
        claims: Claims,
        step: &mut dyn FnMut(),
    ) -> Result<Manifest, Refusal> {
        let (manifest, signature) = read(manifest)?;
        claims.check_use(&manifest)?;
        check_rig(&manifest, rig)?;
        self.check_manifest(&manifest, &signature)?;
        if manifest.length as usize != blob.len() || self.root(blob, step) != manifest.root {
            return Err(Refusal::OtherManifest);
        }
        Ok(manifest)
    }
}

/// A key that signatures are verified with.
#[cfg(feature = "signed")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PublicKey([u8; 32]);

#[cfg(feature = "signed")]
impl PublicKey {
    /// From its 32 bytes.
    pub const fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Its 32 bytes.
    pub const fn to_bytes(self) -> [u8; 32] {
        self.0
    }

    /// From its 64 hexadecimal digits; `None` for anything else. Whether it is a point of the curve shows
    /// when a signature is verified: none passes with one that is not.
    pub const fn from_hex(text: &str) -> Option<Self> {
        const fn digit(byte: u8) -> Option<u8> {
            match byte {
                b'0'..=b'9' => Some(byte - b'0'),
                b'a'..=b'f' => Some(byte - b'a' + 10),
                b'A'..=b'F' => Some(byte - b'A' + 10),
                _ => None,
            }
        }
        let Some((digits, [])) = text.as_bytes().split_first_chunk::<64>() else {
            return None;
        };
        let mut key = [0; 32];
        let mut k = 0;
        while k < 32 {
            let (Some(high), Some(low)) = (digit(digits[2 * k]), digit(digits[2 * k + 1])) else {
                return None;
            };
            key[k] = high << 4 | low;
            k += 1;
        }
        Some(Self(key))
    }

    /// Whether the owner of the key signed these bytes.
    #[cold]
    #[inline(never)]
    pub fn has_signed(&self, bytes: &[u8], signature: &Signature) -> bool {
        let signature = ed25519_dalek::Signature::from_components(signature.r, signature.s);
        ed25519_dalek::VerifyingKey::from_bytes(&self.0)
            .is_ok_and(|key| key.verify_strict(bytes, &signature).is_ok())
    }
}

/// Its 64 hexadecimal digits.
#[cfg(feature = "signed")]
impl core::fmt::Display for PublicKey {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(out, "{byte:02x}"))
    }
}

#[cfg(all(test, feature = "signed"))]
mod tests {
    use super::*;

    /// The second and the third test of RFC 8032, section 7.1.
    const VECTORS: [(&str, &[u8], &str); 2] = [
        (
            "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
            &[0x72],
            "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da\
             085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
        ),
        (
            "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025",
            &[0xaf, 0x82],
            "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac\
             18ff9b538d16f290ae67f760984dc6594a7c15e9716ed28dc027beceea1ec40a",
        ),
    ];

    fn signature(hex: &str) -> Signature {
        let half = |at: usize| PublicKey::from_hex(&hex[at..at + 64]).unwrap().0;
        Signature {
            r: half(0),
            s: half(64),
        }
    }

    #[test]
    fn the_published_vectors_pass_and_nothing_else_does() {
        for (key, message, signed) in VECTORS {
            let keys = Keys::one(PublicKey::from_hex(key).unwrap());
            let signed = signature(signed);
            assert_eq!(keys.check(0, message, &signed), Ok(()));
            assert_eq!(keys.check(1, message, &signed), Err(Refusal::NoSuchKey));
            assert_eq!(keys.check(255, message, &signed), Err(Refusal::NoSuchKey));
            assert_eq!(keys.check(0, &[], &signed), Err(Refusal::BadSignature));
            for bit in 0..256 {
                for mut wrong in [signed; 2] {
                    wrong.r[bit / 8] ^= 1 << (bit % 8);
                    assert_eq!(keys.check(0, message, &wrong), Err(Refusal::BadSignature));
                    wrong = signed;
                    wrong.s[bit / 8] ^= 1 << (bit % 8);
                    assert_eq!(keys.check(0, message, &wrong), Err(Refusal::BadSignature));
                }
            }
        }
        // Another's key, and one that is no point of the curve.
        let signed = signature(VECTORS[0].2);
        let stranger = PublicKey::from_hex(VECTORS[1].0).unwrap();
        for key in [VECTORS[1].0, &"02".repeat(32)] {
            let keys = Keys::two(PublicKey::from_hex(key).unwrap(), stranger);
            assert_eq!(keys.check(0, &[0x72], &signed), Err(Refusal::BadSignature));
        }
    }

    #[test]
    fn a_key_has_64_hexadecimal_digits() {
        assert!(PublicKey::from_hex(VECTORS[0].0).is_some());
        assert!(PublicKey::from_hex(&VECTORS[0].0.to_uppercase()).is_some());
        for bad in ["", "3d", &"0g".repeat(32), &"00".repeat(33)] {
            assert_eq!(PublicKey::from_hex(bad), None);
        }
    }
}
