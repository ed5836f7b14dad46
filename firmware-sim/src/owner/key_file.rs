//! Files of keys, as other programs write and read them: PKCS#8 for the private key, `SubjectPublicKeyInfo`
//! for the public one (RFC 8410), both in PEM (RFC 7468).
//!
//! For Ed25519 both are a fixed head before the 32 bytes of the key, so they are compared, not parsed.

use ed25519_dalek::{Signer, SigningKey};
use ray_device::protocol::Signature;
use ray_device::storage::trust::PublicKey;
use thiserror::Error;

/// SEQUENCE { version 0, { OID 1.3.101.112 }, OCTET STRING { OCTET STRING { 32 bytes } } }
const PRIVATE_HEAD: [u8; 16] = [
    0x30, 0x2e, 0x02, 0x01, 0x00, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x04, 0x22, 0x04, 0x20,
];
/// The same of version 1, with the public key behind it: other programs write this.
const PRIVATE_HEAD_1: [u8; 16] = [
    0x30, 0x51, 0x02, 0x01, 0x01, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x04, 0x22, 0x04, 0x20,
];
const PUBLIC_IN_PRIVATE: [u8; 3] = [0x81, 0x21, 0x00];
/// SEQUENCE { { OID 1.3.101.112 }, BIT STRING { 32 bytes } }
const PUBLIC_HEAD: [u8; 12] = [
    0x30, 0x2a, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x03, 0x21, 0x00,
];
const PRIVATE: &str = "PRIVATE KEY";
const PUBLIC: &str = "PUBLIC KEY";

/// Why a text is no key.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum KeyError {
    /// It is neither PEM nor the digits of a public key.
    #[error(
        "this is no key: give a file that `calib-offline keygen` or `openssl genpkey -algorithm ed25519` wrote, or for a public key its 64 hexadecimal digits"
    )]
    NotAKey,
    /// A private key where the public one is wanted: it must not get about.
    #[error(
        "this is the private key: keep it to yourself, and give the public one (`openssl pkey -in KEY -pubout`, or the .pub.pem beside it)"
    )]
    IsPrivate,
    /// The other way round.
    #[error("this is a public key, and nothing can be signed with it: give the private one")]
    IsPublic,
    /// A passphrase would be needed.
    #[error(
        "this key is encrypted: decrypt it first (`openssl pkey -in KEY -out PLAIN`), or sign with the program that holds it (--to-be-signed)"
    )]
    Encrypted,
    /// A key of another kind, or damaged.
    #[error("this is not a key of Ed25519, or it is damaged")]
    OtherKind,
    /// The two halves of a private key's file do not belong together.
    #[error("the public key in this file is not that of the private one")]
    Halves,
}

/// The private key of a device's owner.
pub struct OwnerKey(SigningKey);

/// Shows the public half only.
impl std::fmt::Debug for OwnerKey {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "OwnerKey({})", self.public())
    }
}

impl OwnerKey {
    /// A new one, from the randomness of the operating system.
    ///
    /// # Errors
    /// If the system has none.
    pub fn generate() -> std::io::Result<Self> {
        let mut seed = [0; 32];
        getrandom::fill(&mut seed)?;
        Ok(Self::from_bytes(&seed))
    }

    /// From its 32 bytes.
    pub fn from_bytes(bytes: &[u8; 32]) -> Self {
        Self(SigningKey::from_bytes(bytes))
    }

    /// From the text of its file.
    ///
    /// # Errors
    /// [`KeyError`].
    pub fn from_pem(text: &str) -> Result<Self, KeyError> {
        let (label, der) = read_pem(text).ok_or(KeyError::NotAKey)?;
        match label {
            PRIVATE => {}
            PUBLIC => return Err(KeyError::IsPublic),
            "ENCRYPTED PRIVATE KEY" => return Err(KeyError::Encrypted),
            _ => return Err(KeyError::OtherKind),
        }
        let (head, rest) = der.split_first_chunk().ok_or(KeyError::OtherKind)?;
        let (seed, public) = rest.split_first_chunk::<32>().ok_or(KeyError::OtherKind)?;
        let key = Self::from_bytes(seed);
        match (head, public.strip_prefix(&PUBLIC_IN_PRIVATE)) {
            (&PRIVATE_HEAD, _) if public.is_empty() => Ok(key),
            (&PRIVATE_HEAD_1, Some(public)) if public == key.public().to_bytes() => Ok(key),
            (&PRIVATE_HEAD_1, Some(_)) => Err(KeyError::Halves),
            _ => Err(KeyError::OtherKind),
        }
    }

    /// The text of its file.
    pub fn to_pem(&self) -> String {
        write_pem(PRIVATE, &[&PRIVATE_HEAD[..], self.0.as_bytes()].concat())
    }

    /// Its public half.
    pub fn public(&self) -> PublicKey {
        PublicKey::from_bytes(self.0.verifying_key().to_bytes())
    }

    /// Signs these bytes.
    pub fn sign(&self, bytes: &[u8]) -> Signature {
        let signature = self.0.sign(bytes);
        Signature {
            r: *signature.r_bytes(),
            s: *signature.s_bytes(),
        }
    }
}

/// A public key from its 64 hexadecimal digits, or from the text of its file.
///
/// # Errors
/// [`KeyError`].
pub fn public_key(text: &str) -> Result<PublicKey, KeyError> {
    if let Some(key) = PublicKey::from_hex(text.trim()) {
        return Ok(key);
    }
    let (label, der) = read_pem(text).ok_or(KeyError::NotAKey)?;
    match label {
        PUBLIC => {}
        _ if label.ends_with(PRIVATE) => return Err(KeyError::IsPrivate),
        _ => return Err(KeyError::OtherKind),
    }
    let key = der.strip_prefix(&PUBLIC_HEAD);
    let key = key.and_then(|key| key.try_into().ok());
    key.map(PublicKey::from_bytes).ok_or(KeyError::OtherKind)
}

/// The text of a public key's file.
pub fn public_pem(key: &PublicKey) -> String {
    write_pem(PUBLIC, &[&PUBLIC_HEAD[..], &key.to_bytes()].concat())
}

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
/// Digits in a line of PEM.
const LINE: usize = 64;

fn write_pem(label: &str, der: &[u8]) -> String {
    let mut digits = Vec::new();
    for group in der.chunks(3) {
        let byte = |at: usize| u32::from(group.get(at).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for place in 0..4 {
            digits.push(if place > group.len() {
                b'='
            } else {
                DIGITS[(bits >> (18 - 6 * place)) as usize & 63]
            });
        }
    }
    let mut text = format!("-----BEGIN {label}-----\n");
    for line in digits.chunks(LINE) {
        text.extend(line.iter().copied().map(char::from));
        text.push('\n');
    }
    text + &format!("-----END {label}-----\n")
}

/// The label and the bytes of the first block in a text.
fn read_pem(text: &str) -> Option<(&str, Vec<u8>)> {
    let (_, rest) = text.split_once("-----BEGIN ")?;
    let (label, rest) = rest.split_once("-----")?;
    let (body, _) = rest.split_once(&format!("-----END {label}-----"))?;
    let digits: Vec<u8> = body
        .bytes()
        .filter(|byte| !byte.is_ascii_whitespace())
        .collect();
    let unpadded = digits.strip_suffix(b"==").or(digits.strip_suffix(b"="));
    let unpadded = unpadded.unwrap_or(&digits);
    let mut bytes = Vec::new();
    for group in unpadded.chunks(4) {
        let mut bits = 0;
        for &digit in group {
            let value = DIGITS.iter().position(|&known| known == digit)?;
            bits = bits << 6 | value as u32;
        }
        bits <<= 6 * (4 - group.len());
        bytes.extend(&bits.to_be_bytes()[1..group.len()]);
    }
    Some((label, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The key of RFC 8410, section 10.3: its first form, and the public key of section 10.1.
    const OF_RFC_8410: &str = "-----BEGIN PRIVATE KEY-----
MC4CAQAwBQYDK2VwBCIEINTuctv5E1hK1bbY8fdp+K06/nwoy/HU++CXqI9EdVhC
-----END PRIVATE KEY-----
";
    const PUBLIC_OF_RFC_8410: &str = "-----BEGIN PUBLIC KEY-----
MCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=
-----END PUBLIC KEY-----
";

    #[test]
    fn the_published_key_is_read_and_written() {
        let key = OwnerKey::from_pem(OF_RFC_8410).unwrap();
        assert_eq!(key.to_pem(), OF_RFC_8410);
        assert_eq!(public_pem(&key.public()), PUBLIC_OF_RFC_8410);
        assert_eq!(public_key(PUBLIC_OF_RFC_8410), Ok(key.public()));
        let digits = "19bf44096984cdfe8541bac167dc3b96c85086aa30b6b6cb0c5c38ad703166e1";
        assert_eq!(key.public().to_string(), digits);
        assert_eq!(public_key(&format!("{digits}\n")), Ok(key.public()));
        // With the public half behind it, as some programs write.
        let seed = key.0.to_bytes();
        let both = |public: [u8; 32]| {
            let der = [&PRIVATE_HEAD_1[..], &seed, &PUBLIC_IN_PRIVATE, &public].concat();
            OwnerKey::from_pem(&write_pem(PRIVATE, &der)).map(|key| key.public())
        };
        assert_eq!(both(key.public().to_bytes()), Ok(key.public()));
        assert_eq!(both([1; 32]), Err(KeyError::Halves));
    }

    #[test]
    fn what_is_no_key_is_told_apart() {
        let private = |text: &str| OwnerKey::from_pem(text).unwrap_err();
        let public = |text: &str| public_key(text).unwrap_err();
        assert_eq!(private(PUBLIC_OF_RFC_8410), KeyError::IsPublic);
        assert_eq!(public(OF_RFC_8410), KeyError::IsPrivate);
        for text in [
            "",
            "0g",
            "-----BEGIN PRIVATE KEY-----\nMC4",
            &"1".repeat(63),
        ] {
            assert_eq!(private(text), KeyError::NotAKey);
            assert_eq!(public(text), KeyError::NotAKey);
        }
        let encrypted = OF_RFC_8410.replace("PRIVATE", "ENCRYPTED PRIVATE");
        assert_eq!(private(&encrypted), KeyError::Encrypted);
        let rsa = OF_RFC_8410.replace("PRIVATE", "RSA PRIVATE");
        assert_eq!(private(&rsa), KeyError::OtherKind);
        let cut = OF_RFC_8410.replace("EdVhC", "E");
        assert_eq!(private(&cut), KeyError::OtherKind);
        // X25519 has another number at the end of its name.
        let x25519 = PUBLIC_OF_RFC_8410.replace("K2VwAyEA", "K2VuAyEA");
        assert_eq!(public(&x25519), KeyError::OtherKind);
    }

    #[test]
    fn keys_are_not_made_twice_and_not_shown() {
        let [one, other] = [(); 2].map(|()| OwnerKey::generate().unwrap());
        assert_ne!(one.to_pem(), other.to_pem());
        assert_eq!(format!("{one:?}"), format!("OwnerKey({})", one.public()));
        assert!(one.public().has_signed(b"text", &one.sign(b"text")));
        assert!(!other.public().has_signed(b"text", &one.sign(b"text")));
    }

    #[test]
    fn every_length_of_pem_comes_back() {
        for length in 0..100 {
            let bytes: Vec<u8> = (0..length).map(|k| k * 37).collect();
            let text = write_pem("X", &bytes);
            assert_eq!(read_pem(&text), Some(("X", bytes)), "{text}");
        }
    }
}
