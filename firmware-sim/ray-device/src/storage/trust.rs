//! Whose blobs a device takes: anybody's, or those that carry the signature of one key.
//!
//! A signature is Ed25519 (RFC 8032) over all bytes of the blob, verified strictly: no second signature of
//! the same blob passes. The key is fixed when the device is built. Bits in the other slot were
//! verified when they came, so a rollback does not ask again.

use crate::protocol::{Refusal, Signature};

/// Whose blobs a device takes.
#[derive(Clone, Copy, Debug, Default)]
pub enum Trust {
    /// Anybody's.
    #[default]
    Anybody,
    /// Those signed by the owner of this key.
    #[cfg(feature = "signed")]
    Signed(PublicKey),
}

impl Trust {
    /// Whether a blob must be signed.
    pub const fn needs_signature(&self) -> bool {
        match self {
            Self::Anybody => false,
            #[cfg(feature = "signed")]
            Self::Signed(_) => true,
        }
    }

    /// Whether this blob may be taken.
    ///
    /// # Errors
    /// [`Refusal::NotSigned`], [`Refusal::BadSignature`].
    #[cfg_attr(
        not(feature = "signed"),
        allow(unused_variables, clippy::unnecessary_wraps)
    )]
    pub fn check(&self, blob: &[u8], signature: Option<&Signature>) -> Result<(), Refusal> {
        match self {
            Self::Anybody => Ok(()),
            #[cfg(feature = "signed")]
            Self::Signed(key) => {
                let signature = signature.ok_or(Refusal::NotSigned)?;
                if key.has_signed(blob, signature) {
                    Ok(())
                } else {
                    Err(Refusal::BadSignature)
                }
            }
        }
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
            let trust = Trust::Signed(PublicKey::from_hex(key).unwrap());
            let signed = signature(signed);
            assert_eq!(trust.check(message, Some(&signed)), Ok(()));
            assert_eq!(trust.check(message, None), Err(Refusal::NotSigned));
            assert_eq!(trust.check(&[], Some(&signed)), Err(Refusal::BadSignature));
            for bit in 0..256 {
                for mut wrong in [signed; 2] {
                    wrong.r[bit / 8] ^= 1 << (bit % 8);
                    assert_eq!(
                        trust.check(message, Some(&wrong)),
                        Err(Refusal::BadSignature)
                    );
                    wrong = signed;
                    wrong.s[bit / 8] ^= 1 << (bit % 8);
                    assert_eq!(
                        trust.check(message, Some(&wrong)),
                        Err(Refusal::BadSignature)
                    );
                }
            }
        }
        // Another's key, and one that is no point of the curve.
        let signed = signature(VECTORS[0].2);
        for key in [VECTORS[1].0, &"02".repeat(32)] {
            let trust = Trust::Signed(PublicKey::from_hex(key).unwrap());
            assert_eq!(
                trust.check(&[0x72], Some(&signed)),
                Err(Refusal::BadSignature)
            );
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
