//! The rules of versions and keys.

use super::{Claims, check_rig, read};
use crate::manifest::{Manifest, NO_LINK};
use crate::protocol::{Refusal, Rig, RigPart, Signature, name};

fn manifest(key: u8, version: u32, least_version: u32, least_key: u8) -> Manifest {
    Manifest {
        key,
        least_key,
        version,
        least_version,
        length: 1,
        checksum: 2,
        identity: [3; 16],
        rig_serial: None,
        root: NO_LINK,
    }
}

const CLAIMS: Claims = Claims {
    newest_version: 7,
    least_version: 5,
    least_key: 0,
};

#[test]
fn an_update_is_newer_or_replaces_what_was_lost() {
    let update = |version, held: &[u32]| {
        CLAIMS.check_update(&manifest(0, version, 0, 0), held.iter().copied())
    };
    let too_old = |version, least| Err(Refusal::VersionTooOld { version, least });
    assert_eq!(update(8, &[7, 6]), Ok(()));
    assert_eq!(update(7, &[7, 6]), too_old(7, 8));
    assert_eq!(update(7, &[6]), Ok(()), "the newest has been lost");
    assert_eq!(update(6, &[7]), too_old(6, 8));
    assert_eq!(
        update(6, &[]),
        too_old(6, 8),
        "an older one never comes back"
    );
    assert_eq!(update(4, &[]), too_old(4, 5));
    assert_eq!(update(u32::MAX, &[]), Ok(()));
}

#[test]
fn a_blob_in_use_is_not_below_the_least_version() {
    let used = |version| CLAIMS.check_use(&manifest(0, version, 0, 0));
    assert_eq!(used(5), Ok(()));
    assert_eq!(used(6), Ok(()));
    assert_eq!(
        used(4),
        Err(Refusal::VersionTooOld {
            version: 4,
            least: 5
        })
    );
}

#[test]
fn claims_only_rise() {
    let after = CLAIMS.after(&manifest(0, 8, 2, 0));
    assert_eq!((after.newest_version, after.least_version), (8, 5));
    let after = CLAIMS.after(&manifest(1, 6, 6, 0));
    assert_eq!((after.newest_version, after.least_version), (7, 6));
    assert_eq!(CLAIMS.joined(Claims::default()), CLAIMS);
    assert_eq!(Claims::default().joined(CLAIMS), CLAIMS);
}

/// Whoever stole key 0 may have signed the highest version there is: the owner goes on with key 1.
#[test]
fn a_key_that_retires_the_one_before_counts_anew() {
    let stolen = CLAIMS.after(&manifest(0, u32::MAX, u32::MAX, 0));
    assert_eq!(stolen.newest_version, u32::MAX);
    let handed_over = manifest(1, 9, 0, 1);
    assert_eq!(stolen.check_update(&handed_over, [u32::MAX]), Ok(()));
    let claims = stolen.after(&handed_over);
    let expected = Claims {
        newest_version: 9,
        least_version: 0,
        least_key: 1,
    };
    assert_eq!(claims, expected);
    assert_eq!(claims.joined(stolen), expected);
    assert_eq!(stolen.joined(claims), expected);
    let retired = Err(Refusal::KeyRetired { key: 0 });
    for version in [10, u32::MAX] {
        let old = manifest(0, version, 0, 0);
        assert_eq!(claims.check_update(&old, []), retired);
        assert_eq!(claims.check_use(&old), retired);
    }
    // From then on it counts as ever: the manifest that handed over is not taken twice.
    assert!(claims.check_update(&handed_over, [9]).is_err());
    assert!(claims.check_update(&manifest(1, 8, 0, 1), []).is_err());
    // With key 1 but without retiring key 0, the count of both goes on.
    assert!(stolen.check_update(&manifest(1, 9, 0, 0), []).is_err());
}

#[test]
fn a_manifest_for_one_rig_fits_no_other() {
    let rig = |serial| Rig {
        serial: name(serial),
        cameras: heapless::Vec::new(),
    };
    let other = Err(Refusal::OtherRig {
        camera: 0,
        what: RigPart::Serial,
        expected: 0,
        found: 0,
    });
    let any = manifest(0, 1, 0, 0);
    let one = Manifest {
        rig_serial: Some(name("A")),
        ..any.clone()
    };
    for own in [None, Some(rig("")), Some(rig("A")), Some(rig("B"))] {
        assert_eq!(check_rig(&any, own.as_ref()), Ok(()));
        let is_own = own.as_ref().is_some_and(|own| own.serial == "A");
        let expected = if is_own { Ok(()) } else { other };
        assert_eq!(check_rig(&one, own.as_ref()), expected, "{own:?}");
    }
}

#[test]
fn what_is_no_manifest_is_told() {
    let signature = Signature {
        r: [1; 32],
        s: [2; 32],
    };
    let good = manifest(0, 1, 0, 0).to_bytes(&signature);
    assert_eq!(read(&good), Ok((manifest(0, 1, 0, 0), signature)));
    assert_eq!(read(&[]), Err(Refusal::NotSigned));
    let bad = |format| Err(Refusal::BadManifest { format });
    assert_eq!(read(&good[1..]), bad(0));
    assert_eq!(read(&[&good[..], &[0]].concat()), bad(0));
    let with = |at: usize, byte| {
        let mut bytes = good;
        bytes[at] = byte;
        bytes
    };
    assert_eq!(read(&with(0, 0)), bad(0));
    assert_eq!(read(&with(4, 9)), bad(9));
    // A key that there is not, one that retires itself, version 0, a serial number behind "any rig".
    for (at, byte) in [(5, 2), (6, 1), (8, 0), (12, 2), (40, 1), (7, 0), (7, 33)] {
        assert_eq!(read(&with(at, byte)), bad(1), "byte {at}");
    }
}
