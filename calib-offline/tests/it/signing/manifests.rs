//! Which manifest goes with a blob: into an image of a slot, to a device, in place of an earlier one.

use super::folder;
use crate::common::{contents, run};
use firmware_sim::owner::public_key;
use firmware_sim::simulated::flash_file::FlashFile;
use firmware_sim::simulated::host::SimulatedDevice;
use ray_device::storage::trust::{Keys, Trust};
use std::fs;
use std::net::{Ipv4Addr, SocketAddr};

/// The image of a slot takes the manifest of its blob and its rig, and no other file.
#[test]
fn a_slot_image_takes_only_its_own_manifest() {
    let folder = folder();
    let path = folder.path();
    let sign = |rig: &str, serial: &[&str]| {
        let sign = ["sign", rig, "--key", "zero.pem", "--version", "3"];
        run(path, &[&sign[..], serial].concat()).assert_code(0);
    };
    sign("small.rays", &["--serial", "R 7"]);
    sign("fast.rays", &[]);
    let before = contents(path);
    let image = |options: &[&str]| {
        let export = ["export", "small.rays", "--format", "slot-image"];
        let part = ["--part", "rp2040", "--region-address", "0x10100000"];
        let rest: &[&str] = if options.contains(&"-o") {
            &["--region-size", "0x20000"]
        } else {
            &["--region-size", "0x20000", "-o", "slot.hex"]
        };
        run(path, &[&export[..], &part, rest, options].concat())
    };
    let own = ["--manifest", "small.rays.manifest"];
    for (options, said) in [
        (
            &["--manifest", "zero.pem"][..],
            &["zero.pem: is not a manifest as calib-offline sign writes it"][..],
        ),
        (
            &["--manifest", "fast.rays.manifest"],
            &[
                "fast.rays.manifest: ",
                "not of this blob",
                "calib-offline sign",
            ],
        ),
        (
            &own,
            &[
                "small.rays.manifest: ",
                "rig \"R 7\" only",
                "no serial number",
                "--serial \"R 7\"",
            ],
        ),
        (
            &[own[0], own[1], "--serial", "R 8"],
            &[
                "small.rays.manifest: ",
                "serial number \"R 8\"",
                "--any-rig",
            ],
        ),
        (
            &[
                own[0],
                own[1],
                "--serial",
                "R 7",
                "-o",
                "small.rays.manifest",
                "--force",
            ],
            &["small.rays.manifest"],
        ),
    ] {
        image(options).assert_code(2).assert_says(said);
        assert_eq!(contents(path), before, "{options:?}");
    }
    image(&[own[0], own[1], "--serial", "R 7"]).assert_code(0);
}

/// A blob that was flashed with its manifest is what a device starts with that gets an owner later.
#[test]
fn the_manifest_beside_the_blob_goes_to_a_device_without_an_owner() {
    let folder = folder();
    let path = folder.path();
    let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let blank = || SimulatedDevice::start(any_port, &[]).unwrap();
    let flash = |device: &SimulatedDevice, file: &str| {
        let address = format!("tcp:{}", device.address());
        run(path, &["flash", file, "--device", &address])
    };
    let sign = |rig: &str, options: &[&str]| {
        let sign = ["sign", rig, "--key", "zero.pem", "--version", "3"];
        run(path, &[&sign[..], options].concat()).assert_code(0);
    };
    sign("small.rays", &[]);
    // One that a device without an owner would refuse is left out, and that is said.
    let device = blank();
    let good = fs::read(path.join("small.rays.manifest")).unwrap();
    fs::write(path.join("fast.rays.manifest"), &good).unwrap();
    flash(&device, "fast.rays")
        .assert_code(0)
        .assert_says(&["fast.rays.manifest is of another blob", "sign it again"]);
    fs::write(path.join("small.rays.manifest"), &good[1..]).unwrap();
    flash(&device, "small.rays")
        .assert_code(0)
        .assert_says(&["small.rays.manifest is damaged"]);
    // The device has it without the manifest now, and what that means is said.
    fs::write(path.join("small.rays.manifest"), &good).unwrap();
    flash(&device, "small.rays").assert_code(0).assert_prints(&[
        "nothing was sent, not its manifest either",
        "flash another blob",
    ]);
    let kept = path.join("device.flash");
    let opened = || FlashFile::open(&kept, None).unwrap().flash;
    let device = SimulatedDevice::start_with(any_port, opened()).unwrap();
    sign("fast.rays", &["--serial", "R 7", "--force"]);
    flash(&device, "fast.rays")
        .assert_code(0)
        .assert_says(&["is for a rig of another serial number"]);
    flash(&device, "small.rays").assert_code(0);
    drop(device);
    let zero = fs::read_to_string(path.join("zero.pub.pem")).unwrap();
    let trust = Trust::Owner(Keys::one(public_key(&zero).unwrap()));
    let owned = SimulatedDevice::start_trusting(any_port, opened(), trust).unwrap();
    let address = format!("tcp:{}", owned.address());
    run(path, &["device", "status", "--device", &address])
        .assert_code(0)
        .assert_prints(&["version 3, in use"]);
}

/// Only what stands in the way of the output is replaced with --force, never a file that is read.
#[test]
fn sign_replaces_what_it_is_told_to_and_no_key() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("notes.txt"), "of somebody").unwrap();
    let before = contents(path);
    let sign = ["sign", "small.rays", "--version", "1", "--key", "zero.pem"];
    for (place, said) in [
        ("notes.txt", "--force"),
        ("zero.pem", "what the command reads"),
        ("small.rays", "what the command reads"),
    ] {
        run(path, &[&sign[..], &["-o", place]].concat())
            .assert_code(2)
            .assert_says(&[said]);
    }
    for place in ["zero.pem", "small.rays"] {
        run(path, &[&sign[..], &["-o", place, "--force"]].concat()).assert_code(2);
    }
    assert_eq!(contents(path), before);
    run(path, &[&sign[..], &["-o", "notes.txt", "--force"]].concat()).assert_code(0);
    assert_eq!(fs::read(path.join("notes.txt")).unwrap().len(), 168);
    run(path, &["keygen", "-o", "zero.pem", "--force"]).assert_code(2);
}
