//! A device that takes only blobs signed by the owner of one key, on the host and in QEMU.

use crate::rig;
use ed25519_dalek::{Signer, SigningKey};
use firmware_sim::client::{ClientError, DeviceClient, FlashOptions, Flashed};
use firmware_sim::simulated::flash_file;
use firmware_sim::simulated::host::SimulatedDevice;
use firmware_sim::simulated::qemu::{self, QemuDevice};
use ray_device::protocol::{Refusal, Signature};
use ray_device::storage::trust::{PublicKey, Trust};

fn key(seed: u8) -> SigningKey {
    SigningKey::from_bytes(&[seed; 32])
}

/// The public half of a key.
fn public(key: &SigningKey) -> PublicKey {
    PublicKey::from_bytes(key.verifying_key().to_bytes())
}

fn signature(key: &SigningKey, blob: &[u8]) -> Signature {
    Signature::from_bytes(&key.sign(blob).to_bytes()).unwrap()
}

/// What comes of flashing a blob with this signature.
fn flash(
    client: &mut DeviceClient,
    blob: &[u8],
    signature: Option<Signature>,
) -> Result<Flashed, Refusal> {
    let options = FlashOptions {
        signature,
        ..FlashOptions::default()
    };
    client
        .flash(blob, &options, &mut |_| {})
        .map_err(|error| match error {
            ClientError::Refused(refusal) => refusal,
            other => panic!("{other}"),
        })
}

/// Tries every wrong signature, and the right one, on an empty device that trusts the owner of this key.
fn check(client: &mut DeviceClient, owner: &SigningKey) {
    assert!(client.greeting().needs_signature);
    let (first, second) = (rig::blob(), rig::blob_of([9; 16]));
    let signed = signature(owner, &first);
    flash(client, &first, Some(signed)).unwrap();

    let refused = |client: &mut DeviceClient, signature| {
        let refusal = flash(client, &second, signature).unwrap_err();
        let blob = client.status().unwrap().blob.unwrap();
        assert_eq!(blob.identity, rig::IDENTITY, "the first one stays in use");
        refusal
    };
    assert_eq!(refused(client, None), Refusal::NotSigned);
    // Of the other blob, by somebody else, and damaged.
    let mut damaged = signature(owner, &second);
    damaged.s[0] ^= 1;
    for wrong in [signed, signature(&key(8), &second), damaged] {
        assert_eq!(refused(client, Some(wrong)), Refusal::BadSignature);
    }
    flash(client, &second, Some(signature(owner, &second))).unwrap();
    // What was verified when it came is not asked about again.
    client.rollback().unwrap();
    assert_eq!(
        client.status().unwrap().blob.unwrap().identity,
        rig::IDENTITY
    );
}

#[test]
fn the_simulated_device_takes_signed_blobs_only() {
    let owner = key(7);
    let trust = Trust::Signed(public(&owner));
    let flash = flash_file::blank(None).unwrap();
    let any_port = "127.0.0.1:0".parse().unwrap();
    let device = SimulatedDevice::start_trusting(any_port, flash, trust).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    check(&mut client, &owner);
}

#[test]
fn a_device_without_a_key_takes_any_blob_signed_or_not() {
    let device = SimulatedDevice::start("127.0.0.1:0".parse().unwrap(), &[]).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    assert!(!client.greeting().needs_signature);
    flash(&mut client, &rig::blob(), None).unwrap();
    let other = rig::blob_of([9; 16]);
    flash(&mut client, &other, Some(signature(&key(8), &rig::blob()))).unwrap();
}

#[test]
fn the_image_in_qemu_takes_signed_blobs_only() {
    let owner = key(7);
    let image = qemu::build_signed_image("device_signed", &public(&owner).to_string()).unwrap();
    let device = QemuDevice::start("127.0.0.1:0".parse().unwrap(), &image, None).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    check(&mut client, &owner);
}

/// The figure of `RELIABILITY.md`, printed with `--nocapture`. What is asserted is its order: the count of
/// a call that ended early, or that was moved out of the measured stretch, has another.
#[test]
fn verifying_takes_a_counted_number_of_instructions() {
    // QEMU's time per instruction is 2^10 ns, a tick of the timer 40 ns.
    const TICKS_PER_INSTRUCTION: f64 = 1024.0 / 40.0;
    let image =
        qemu::build_signed_image("counting_signature", &public(&key(7)).to_string()).unwrap();
    let blob = tempfile::NamedTempFile::new().unwrap();
    let output = qemu::DEVICE.run_counting(&image, blob.path(), 10).unwrap();
    assert!(output.status.success());
    let printed = String::from_utf8(output.stdout).unwrap();
    let counted: Vec<(f64, f64)> = printed
        .lines()
        .map(|line| {
            let mut words = line.split(' ').map(|word| word.parse().unwrap_or(f64::NAN));
            let (bytes, ticks) = (words.next().unwrap(), words.next().unwrap());
            (bytes, ticks / TICKS_PER_INSTRUCTION)
        })
        .collect();
    let [(short, few), (long, more)] = counted[..] else {
        panic!("{printed}");
    };
    let per_byte = (more - few) / (long - short);
    println!("{few:.0} instructions for {short} bytes, {per_byte:.1} for each byte more");
    // SHA-512 takes some 30 to 100 a byte, the curve some millions: other orders would be wrong counts.
    assert!((10.0..300.0).contains(&per_byte), "{per_byte}");
    assert!((1e6..1e8).contains(&few), "{few}");
}
