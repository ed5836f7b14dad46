//! The bytes of manifests and orders. A test that fails here means that what owners have signed is no longer
//! taken: raise the format, or do not change it.

use super::{Action, MANIFEST_LENGTH, Manifest, OrderText, SIGNED_LENGTH, SIGNED_ORDER_LENGTH};
use crate::protocol::{Signature, name};

fn manifest() -> Manifest {
    Manifest {
        key: 1,
        least_key: 1,
        version: 0x0102_0304,
        least_version: 5,
        length: 600,
        checksum: 0xa0b0_c0d0,
        identity: [6; 16],
        rig_serial: Some(name("R-7")),
        root: [8; 32],
    }
}

#[test]
fn bytes_of_a_manifest() {
    #[rustfmt::skip]
    let body = [
        &b"RayM\x01\x01\x01\x03"[..],
        &[4, 3, 2, 1, 5, 0, 0, 0, 0x58, 2, 0, 0, 0xd0, 0xc0, 0xb0, 0xa0],
        &[6; 16],
        b"R-7", &[0; 29],
        &[8; 32],
    ].concat();
    let signed = [&b"ray-device manifest\0\0\0\0\0"[..], &body].concat();
    assert_eq!(manifest().to_be_signed()[..], signed);
    assert_eq!(signed.len(), SIGNED_LENGTH);
    let signature = Signature {
        r: [1; 32],
        s: [2; 32],
    };
    let bytes = manifest().to_bytes(&signature);
    assert_eq!(bytes[..], [&body[..], &[1; 32], &[2; 32]].concat());
    assert_eq!((bytes.len(), MANIFEST_LENGTH), (168, 168));
    assert_eq!(Manifest::parse(&bytes), Ok((manifest(), signature)));
    let any = Manifest {
        rig_serial: None,
        ..manifest()
    };
    let bytes = any.to_bytes(&signature);
    assert_eq!(bytes[7], 255);
    assert_eq!(Manifest::parse(&bytes), Ok((any, signature)));
}

#[test]
fn bytes_of_orders() {
    let order = OrderText {
        action: Action::Rollback,
        key: 1,
        serial: "R-7",
        sequence: 258,
        update: 3,
        checksum: 4,
    };
    #[rustfmt::skip]
    let bytes = [
        &b"ray-device order\0\0\0\0\0\0\0\0"[..],
        &[1, 1, 3, 0, 2, 1, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0],
        b"R-7", &[0; 29],
    ].concat();
    assert_eq!(order.to_be_signed()[..], bytes);
    assert_eq!(bytes.len(), SIGNED_ORDER_LENGTH);
    let abort = OrderText {
        action: Action::Abort,
        ..order
    };
    assert_eq!(abort.to_be_signed()[24], 2);
}

/// Links by the definition, from the last piece to the first.
#[cfg(feature = "signed")]
#[test]
fn the_chain_covers_every_byte() {
    use super::{NO_LINK, link, root};
    let blob: Vec<u8> = (0..1200_u32).map(|k| (k * k / 7) as u8).collect();
    let mut pieces = 0;
    let whole = root(&blob, || pieces += 1);
    assert_eq!(pieces, 3);
    let last = link(&blob[1024..], &NO_LINK);
    let middle = link(&blob[512..1024], &last);
    assert_eq!(whole, link(&blob[..512], &middle));
    for at in [0, 511, 512, 1023, 1024, 1199] {
        let mut other = blob.clone();
        other[at] ^= 1;
        assert_ne!(root(&other, || ()), whole, "byte {at}");
    }
    assert_ne!(root(&blob[..1199], || ()), whole);
    assert_eq!(root(&[], || ()), NO_LINK);
    // SHA-512 of 32 zeros, as any other program gives it.
    let known = [0x50, 0x46, 0xad, 0xc1, 0xdb, 0xa8, 0x38, 0x86];
    assert_eq!(link(&[], &NO_LINK)[..8], known);
}
