//! A device with an owner over TCP: on the host, in QEMU, and with its flash in a file.

use std::path::Path;
use std::process::Command;

use crate::owner::{blob, key, manifest, order, owner, version};
use crate::rig;
use crate::running::Running;
use firmware_sim::client::{ClientError, DeviceClient, FlashOptions, Flashed};
use firmware_sim::owner::public_pem;
use firmware_sim::simulated::flash_file;
use firmware_sim::simulated::host::SimulatedDevice;
use firmware_sim::simulated::qemu::{self, QemuDevice};
use ray_device::manifest::{Action, ManifestBytes};
use ray_device::protocol::{Order, Refusal, Request};
use ray_device::storage::trust::Keys;

/// What comes of flashing a blob with this manifest.
fn flash(
    client: &mut DeviceClient,
    blob: &[u8],
    manifest: Option<ManifestBytes>,
) -> Result<Flashed, Refusal> {
    let options = FlashOptions {
        manifest,
        ..FlashOptions::default()
    };
    client
        .flash(blob, &options, &mut |_| {})
        .map_err(|error| match error {
            ClientError::Refused(refusal) => refusal,
            other => panic!("{other}"),
        })
}

fn owners_order(client: &mut DeviceClient, action: Action) -> Order {
    let status = client.status().unwrap();
    match order(action, 0, &status) {
        Request::Order(order) => order,
        other => panic!("{other:?}"),
    }
}

/// Tries what must not work, and what must, on an empty device of this owner.
fn check(client: &mut DeviceClient) {
    assert!(client.greeting().needs_signature);
    let (first, second) = (blob(1), blob(2));
    let flashed = flash(client, &first, Some(manifest(&first, &version(1)))).unwrap();
    assert_eq!(flashed.stored.version, 1);
    let again = flash(client, &first, Some(manifest(&first, &version(1)))).unwrap();
    assert!(again.was_active);

    let refused = |client: &mut DeviceClient, manifest| {
        let refusal = flash(client, &second, manifest).unwrap_err();
        let active = client.status().unwrap().active_slot;
        assert_eq!(active, Some(0), "the first one stays in use");
        refusal
    };
    assert_eq!(refused(client, None), Refusal::NotSigned);
    let good = manifest(&second, &version(2));
    let mut damaged = good;
    damaged[130] ^= 1;
    assert_eq!(refused(client, Some(damaged)), Refusal::BadSignature);
    let others = manifest(&first, &version(2));
    assert_eq!(refused(client, Some(others)), Refusal::OtherManifest);
    let older = manifest(&second, &version(1));
    assert!(matches!(
        refused(client, Some(older)),
        Refusal::VersionTooOld { .. }
    ));
    flash(client, &second, Some(good)).unwrap();
    assert_eq!(client.measure(&rig::matches(20, 1)).unwrap().len(), 20);

    let error = client.rollback().unwrap_err();
    assert!(
        matches!(error, ClientError::Refused(Refusal::NeedsOrder)),
        "{error}"
    );
    let order = owners_order(client, Action::Rollback);
    let stored = client.order(&order).unwrap().unwrap();
    assert_eq!((stored.slot, stored.version), (0, 1));
    let error = client.order(&order).unwrap_err();
    assert!(
        matches!(error, ClientError::Refused(Refusal::StaleOrder { .. })),
        "{error}"
    );
    let abort = owners_order(client, Action::Abort);
    assert_eq!(client.order(&abort).unwrap(), None);
    let third = blob(3);
    flash(client, &third, Some(manifest(&third, &version(3)))).unwrap();
    let claims = client.status().unwrap().owner.unwrap().claims;
    assert_eq!(claims.newest_version, 3);
}

#[test]
fn the_simulated_device_obeys_its_owner_only() {
    let flash = flash_file::blank(None).unwrap();
    let any_port = "127.0.0.1:0".parse().unwrap();
    let device = SimulatedDevice::start_trusting(any_port, flash, owner()).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    check(&mut client);
}

#[test]
fn a_device_without_an_owner_takes_any_blob_signed_or_not() {
    let device = SimulatedDevice::start("127.0.0.1:0".parse().unwrap(), &[]).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    assert!(!client.greeting().needs_signature);
    flash(&mut client, &blob(1), None).unwrap();
    flash(&mut client, &blob(2), Some(manifest(&blob(2), &version(1)))).unwrap();
    client.rollback().unwrap();
    client.abort_update().unwrap();
    let order = owners_order(&mut client, Action::Abort);
    let error = client.order(&order).unwrap_err();
    assert!(
        matches!(error, ClientError::Refused(Refusal::NoOwner)),
        "{error}"
    );
}

#[test]
fn the_image_in_qemu_obeys_its_owner_only() {
    let keys = Keys::two(key(0).public(), key(1).public());
    let image = qemu::build_signed_image("device_signed", keys).unwrap();
    let device = QemuDevice::start("127.0.0.1:0".parse().unwrap(), &image, None).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    check(&mut client);
}

/// Starts a device that is expected not to start; what it says.
fn refuses_to_start(kind: &str, file: &Path, keys: &[&str]) -> String {
    let keys = keys.iter().flat_map(|key| ["--public-key", key]);
    let output = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
        .args([kind, "--flash-file"])
        .arg(file)
        .args(keys)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A mistaken key can be undone as long as nothing was signed with it; then the flash is the owner's.
#[test]
fn the_key_may_be_corrected_until_something_was_signed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let [zero, one, stranger] = [0, 1, 9].map(|number| key(number).public().to_string());
    let pem = folder.path().join("key.pub.pem");
    std::fs::write(&pem, public_pem(&key(0).public())).unwrap();
    let start = |keys: &[&str]| {
        let arguments: Vec<_> = keys.iter().flat_map(|key| ["--public-key", key]).collect();
        Running::keeping("host", &file, &arguments)
    };
    // Without an owner, then with a mistaken one, by whom nothing is signed.
    let device = start(&[]);
    flash(&mut device.client(), &blob(1), None).unwrap();
    drop(device);
    let device = start(&[&stranger]);
    let refusal = flash(
        &mut device.client(),
        &blob(2),
        Some(manifest(&blob(2), &version(1))),
    );
    assert_eq!(refusal.unwrap_err(), Refusal::BadSignature);
    drop(device);
    let device = start(&[]);
    assert!(
        device.client().status().unwrap().blob.is_ok(),
        "still there"
    );
    drop(device);
    // The right one, from a file.
    let device = start(&[pem.to_str().unwrap()]);
    flash(
        &mut device.client(),
        &blob(2),
        Some(manifest(&blob(2), &version(1))),
    )
    .unwrap();
    drop(device);
    for kind in ["host", "qemu"] {
        let said = refuses_to_start(kind, &file, &[&stranger]);
        assert!(said.contains("signed with another key"), "{said}");
        let said = refuses_to_start(kind, &file, &[&stranger, &one]);
        assert!(said.contains("signed with another key"), "{said}");
        let said = refuses_to_start(kind, &file, &[]);
        assert!(said.contains("--public-key"), "{said}");
    }
    // A second key may come later.
    let device = start(&[&zero, &one]);
    let status = device.client().status().unwrap();
    assert_eq!(status.owner.unwrap().keys.iter().flatten().count(), 2);
    assert!(status.blob.is_ok());
}

#[test]
fn what_is_no_public_key_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let private = folder.path().join("key.pem");
    std::fs::write(&private, key(0).to_pem()).unwrap();
    let [zero, one, other] = [0, 1, 9].map(|number| key(number).public().to_string());
    for (keys, said) in [
        (&[private.to_str().unwrap()][..], "this is the private key"),
        (&["12"], "nor a file that can be read"),
        (&[zero.as_str(), zero.as_str()], "are the same"),
        (
            &[zero.as_str(), one.as_str(), other.as_str()],
            "two keys at most",
        ),
    ] {
        let found = refuses_to_start("host", &file, keys);
        assert!(found.contains(said), "{found}");
        assert!(!file.exists());
    }
}

/// The figure of `RELIABILITY.md`, printed with `--nocapture`. What is asserted is its order: the count of
/// a call that ended early, or that was moved out of the measured stretch, has another.
#[test]
fn verifying_takes_a_counted_number_of_instructions() {
    // QEMU's time per instruction is 2^10 ns, a tick of the timer 40 ns.
    const TICKS_PER_INSTRUCTION: f64 = 1024.0 / 40.0;
    let image = qemu::build_signed_image("counting_signature", Keys::one(key(0).public())).unwrap();
    let blob = tempfile::NamedTempFile::new().unwrap();
    let output = qemu::DEVICE.run_counting(&image, blob.path(), 10).unwrap();
    assert!(output.status.success());
    let printed = String::from_utf8(output.stdout).unwrap();
    let counted: Vec<f64> = printed
        .lines()
        .map(|line| {
            let ticks = line.split(' ').nth(1).unwrap_or_default();
            ticks.parse().unwrap_or(f64::NAN) / TICKS_PER_INSTRUCTION
        })
        .collect();
    let [manifest, short, long] = counted[..] else {
        panic!("{printed}");
    };
    let per_byte = (long - short) / 4096.0;
    println!("{manifest:.0} instructions for a manifest, {per_byte:.1} for each byte of the blob");
    // SHA-512 takes some 30 to 100 a byte, the curve some millions: other orders would be wrong counts.
    assert!((10.0..300.0).contains(&per_byte), "{per_byte}");
    assert!((1e6..1e8).contains(&manifest), "{manifest}");
}
