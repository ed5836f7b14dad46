//! `keygen`, `sign`, and what a device with an owner says to `flash` and `device`: the real binary, with
//! openssl beside it.

mod manifests;

use crate::common::documented::assert_documented;
use crate::common::{Run, contents, run};
use firmware_sim::owner::public_key;
use firmware_sim::simulated::flash_file;
use firmware_sim::simulated::host::SimulatedDevice;
use ray_device::protocol::{CameraStatus, Rig, name};
use ray_device::storage::trust::{Keys, Trust};
use ray_runtime::RayBlob;
use std::fs;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::process::Command;

static SMALL: &[u8] = include_bytes!("../../../data/golden/stereo-v3-small.rays");
static FAST: &[u8] = include_bytes!("../../../data/golden/stereo-v3-fast.rays");

/// A folder with two blobs, and the keys `zero.pem` and `one.pem`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("small.rays"), SMALL).unwrap();
    fs::write(folder.path().join("fast.rays"), FAST).unwrap();
    for key in ["zero.pem", "one.pem"] {
        run(folder.path(), &["keygen", "-o", key]).assert_code(0);
    }
    folder
}

/// A device of the owner of both keys, on the rig of the golden blobs with this serial number.
fn device(path: &Path, serial: &str) -> (SimulatedDevice, String) {
    let [zero, one] = ["zero.pub.pem", "one.pub.pem"]
        .map(|file| public_key(&fs::read_to_string(path.join(file)).unwrap()).unwrap());
    let bytes = ray_runtime::Aligned(*include_bytes!("../../../data/golden/stereo-v3-small.rays"));
    let blob = RayBlob::open(&bytes.0).unwrap();
    let cameras = (0..2).map(|index| {
        let camera = blob.camera(index).unwrap();
        CameraStatus {
            name: name(camera.name),
            width_px: camera.sensor_width,
            height_px: camera.sensor_height,
        }
    });
    let own = Rig {
        serial: name(serial),
        cameras: cameras.collect(),
    };
    let flash = flash_file::blank(Some(&own)).unwrap();
    let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let trust = Trust::Owner(Keys::two(zero, one));
    let device = SimulatedDevice::start_trusting(any_port, flash, trust).unwrap();
    let address = format!("tcp:{}", device.address());
    (device, address)
}

#[test]
fn a_device_with_an_owner_from_the_key_to_the_rollback() {
    let folder = folder();
    let path = folder.path();
    let (_device, address) = device(path, "R 7");
    let at = ["--device", &address];
    let flash = |file: &str| run(path, &[&["flash", file], &at[..]].concat());
    let ask = |words: &[&str]| run(path, &[&["device"], words, &at[..]].concat());

    // What to run is said, and works as it is said.
    let said = flash("small.rays");
    said.assert_code(2).assert_says(&[
        "has an owner",
        "calib-offline sign small.rays --key key.pem --version 1 --serial \"R 7\"",
    ]);
    let sign = ["sign", "small.rays", "--key", "zero.pem", "--version", "1"];
    run(path, &[&sign[..], &["--serial", "R 7"]].concat())
        .assert_code(0)
        .assert_prints(&["small.rays.manifest", "version 1", "for rig R 7"]);
    flash("small.rays")
        .assert_code(0)
        .assert_prints(&["version 1"]);
    flash("fast.rays")
        .assert_code(2)
        .assert_says(&["--version 2"]);
    // Not the manifest of another blob, of another rig, by another key, or an older one.
    let manifest = ["fast.rays", "--manifest", "small.rays.manifest"];
    run(path, &[&["flash"], &manifest[..], &at[..]].concat())
        .assert_code(2)
        .assert_says(&["the manifest is of another blob"]);
    let sign = |options: &[&str]| run(path, &[&["sign", "fast.rays"], options].concat());
    sign(&["--key", "zero.pem", "--version", "2", "--serial", "R 8"]).assert_code(0);
    flash("fast.rays")
        .assert_code(2)
        .assert_says(&["another serial number"]);
    sign(&["--key", "one.pem", "--version", "2"]).assert_code(0);
    flash("fast.rays")
        .assert_code(2)
        .assert_says(&["not by the owner's key"]);
    sign(&["--key", "zero.pem", "--version", "1", "--any-rig"]).assert_code(0);
    flash("fast.rays")
        .assert_code(2)
        .assert_says(&["version 1 is too old", "--version"]);
    sign(&["--key", "zero.pem", "--version", "2", "--any-rig"]).assert_code(0);
    flash("fast.rays").assert_code(0);
    flash("fast.rays")
        .assert_code(0)
        .assert_prints(&["already"]);

    ask(&["rollback"])
        .assert_code(2)
        .assert_says(&["has an owner", "--key key.pem"]);
    run(path, &["keygen", "-o", "stranger.pem"]).assert_code(0);
    ask(&["rollback", "--key", "stranger.pem"])
        .assert_code(2)
        .assert_says(&["another owner"]);
    ask(&["rollback", "--key", "zero.pem"])
        .assert_code(0)
        .assert_prints(&["is in use again"]);
    ask(&["abort"])
        .assert_code(2)
        .assert_says(&["has an owner"]);
    ask(&["abort", "--key", "one.pem"])
        .assert_code(0)
        .assert_prints(&["no update was under way"]);
    ask(&["status"]).assert_code(0).assert_prints(&[
        "changed by its owner only: key 0 ",
        "takes versions from 3 on",
        "version 1, in use",
    ]);

    // Key 0 is retired, and so is what it signed.
    let rotate = [
        "--key",
        "one.pem",
        "--key-number",
        "1",
        "--retire-keys-below",
    ];
    sign(&[&rotate[..], &["1", "--version", "1"]].concat()).assert_code(0);
    flash("fast.rays").assert_code(0);
    ask(&["status"])
        .assert_code(0)
        .assert_prints(&["(retired)", "takes versions from 2 on"]);
    ask(&["rollback", "--key", "zero.pem"])
        .assert_code(2)
        .assert_says(&["key 0 is retired"]);
}

#[test]
fn the_objects_are_documented() {
    let folder = folder();
    let path = folder.path();
    let (_device, address) = device(path, "R 7");
    let json = |words: &[&str]| {
        let run = run(path, &[words, &["--json"]].concat());
        run.assert_code(0).json()
    };
    let made = json(&["keygen", "-o", "another.pem"]);
    let digits = made["public_key"].as_str().unwrap();
    assert_eq!(digits.len(), 64);
    assert_documented(
        "keygen",
        "calib-offline/keygen/1",
        std::slice::from_ref(&made),
        &[],
    );
    let sign = ["sign", "small.rays", "--key", "zero.pem", "--version", "4"];
    let signed = json(&sign);
    assert_documented("sign", "calib-offline/sign/1", &[signed], &[]);
    let flashed = json(&["flash", "small.rays", "--device", &address]);
    assert_eq!(flashed["version"], 4);
    assert_documented("flash", "calib-offline/flash/1", &[flashed], &[]);
    let status = json(&["device", "status", "--device", &address]);
    assert_eq!(status["owner"]["newest_version"], 4);
    let abort = ["device", "abort", "--key", "zero.pem", "--device", &address];
    let aborted = json(&abort);
    assert_documented("device", "calib-offline/device-abort/1", &[aborted], &[]);
}

#[test]
fn a_key_is_for_its_owner_alone_and_never_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let made = run(path, &["keygen", "-o", "key.pem"]);
    made.assert_code(0);
    let digits = made.stdout.lines().next().unwrap();
    let public = fs::read_to_string(path.join("key.pub.pem")).unwrap();
    assert_eq!(public_key(&public).unwrap().to_string(), digits);
    #[cfg(unix)]
    for (file, expected) in [("key.pem", 0o600), ("key.pub.pem", 0o644)] {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = fs::metadata(path.join(file)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, expected, "{file}");
    }
    let before = contents(path);
    run(path, &["keygen", "-o", "key.pem"])
        .assert_code(2)
        .assert_says(&["key.pem: exists", "never replaced"]);
    run(path, &["keygen", "-o", "none/key.pem"]).assert_code(2);
    run(path, &["keygen", "-o", "-"])
        .assert_code(2)
        .assert_says(&["several files", "./-"]);
    assert_eq!(contents(path), before);
    fs::remove_file(path.join("key.pem")).unwrap();
    run(path, &["keygen", "-o", "key.pem"])
        .assert_code(2)
        .assert_says(&["key.pub.pem: exists"]);
    assert!(!path.join("key.pem").exists());
}

#[allow(clippy::too_many_lines, reason = "a table")]
#[test]
fn what_cannot_be_signed_is_said_and_nothing_is_written() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("cut.rays"), &SMALL[..2000]).unwrap();
    fs::write(path.join("short.sig"), [0; 63]).unwrap();
    fs::write(path.join("zeros.sig"), [0; 64]).unwrap();
    fs::write(path.join("notes.txt"), "of somebody").unwrap();
    let before = contents(path);
    let key = ["--key", "zero.pem"];
    let cases: &[(&[&str], &[&str])] = &[
        (&["small.rays", "--version", "1"], &["--key"]),
        (&["small.rays", key[0], key[1]], &["--version"]),
        (&["small.rays", key[0], key[1], "--version", "0"], &["0"]),
        (
            &["cut.rays", key[0], key[1], "--version", "1"],
            &["cut.rays", "cut off"],
        ),
        (
            &["zero.pem", key[0], key[1], "--version", "1"],
            &["zero.pem", "a blob"],
        ),
        (
            &["small.rays", "--key", "zero.pub.pem", "--version", "1"],
            &["zero.pub.pem", "nothing can be signed with it"],
        ),
        (
            &["small.rays", "--key", "none.pem", "--version", "1"],
            &["none.pem: does not exist"],
        ),
        (
            &["small.rays", "--key", "notes.txt", "--version", "1"],
            &["notes.txt", "keygen"],
        ),
        (
            &[
                "small.rays",
                key[0],
                key[1],
                "--version",
                "1",
                "--least-version",
                "2",
            ],
            &["none may rule itself out"],
        ),
        (
            &[
                "small.rays",
                key[0],
                key[1],
                "--version",
                "1",
                "--retire-keys-below",
                "1",
            ],
            &["none may retire itself"],
        ),
        (
            &[
                "small.rays",
                key[0],
                key[1],
                "--version",
                "1",
                "--key-number",
                "2",
            ],
            &["keys 0 and 1"],
        ),
        (
            &[
                "small.rays",
                key[0],
                key[1],
                "--version",
                "1",
                "--serial",
                "",
            ],
            &["serial number"],
        ),
        (
            &[
                "small.rays",
                key[0],
                key[1],
                "--version",
                "1",
                "-o",
                "notes.txt",
            ],
            &["notes.txt: exists"],
        ),
        (
            &["small.rays", "--signature", "short.sig", "--version", "1"],
            &["short.sig: is not an Ed25519 signature: 64 bytes"],
        ),
        (
            &[
                "small.rays",
                "--signature",
                "zeros.sig",
                "--version",
                "1",
                "--public-key",
                "zero.pub.pem",
            ],
            &["not by --public-key"],
        ),
    ];
    for (arguments, said) in cases {
        run(path, &[&["sign"], *arguments].concat())
            .assert_code(2)
            .assert_says(said);
        assert_eq!(contents(path), before, "{arguments:?}");
    }
}

/// Runs openssl in a folder; `None`, and a loud line, where there is none.
fn openssl(path: &Path, arguments: &str) -> Option<bool> {
    let arguments = arguments.split(' ');
    match Command::new("openssl")
        .args(arguments)
        .current_dir(path)
        .output()
    {
        Ok(output) => Some(output.status.success()),
        Err(error) => {
            eprintln!(
                "NOT TESTED: openssl cannot be run ({error}), keys and signatures were not compared with it"
            );
            None
        }
    }
}

/// Keys and signatures go both ways between us and openssl.
#[test]
fn openssl_reads_our_keys_and_we_read_its() {
    let folder = folder();
    let path = folder.path();
    let tbs = ["--version", "7", "--serial", "R-7"];
    let sign = |words: &[&str]| run(path, &[&["sign", "small.rays"], words, &tbs[..]].concat());
    let assert_made = |run: Run| {
        run.assert_code(0);
    };
    if openssl(path, "genpkey -algorithm ed25519 -out theirs.pem").is_none() {
        return;
    }
    assert_eq!(
        openssl(path, "pkey -in theirs.pem -pubout -out theirs.pub.pem"),
        Some(true)
    );
    // Their key, our signature; our key, their public half of it.
    assert_made(sign(&["--key", "theirs.pem", "-o", "a.manifest"]));
    assert_made(sign(&["--key", "zero.pem", "-o", "b.manifest"]));
    assert_eq!(
        openssl(path, "pkey -in zero.pem -pubout -out derived.pub.pem"),
        Some(true)
    );
    let [ours, derived] = ["zero.pub.pem", "derived.pub.pem"].map(|file| fs::read(path.join(file)));
    assert_eq!(ours.unwrap(), derived.unwrap());
    assert_made(sign(&["--to-be-signed", "tbs.bin"]));
    for (manifest, public) in [("a", "theirs.pub.pem"), ("b", "zero.pub.pem")] {
        let bytes = fs::read(path.join(format!("{manifest}.manifest"))).unwrap();
        fs::write(path.join("sig"), &bytes[104..]).unwrap();
        let verify =
            format!("pkeyutl -verify -pubin -inkey {public} -rawin -in tbs.bin -sigfile sig");
        assert_eq!(openssl(path, &verify), Some(true), "{manifest}");
        let other = "pkeyutl -verify -pubin -inkey one.pub.pem -rawin -in tbs.bin -sigfile sig";
        assert_eq!(openssl(path, other), Some(false), "{manifest}");
    }
    // Their signature with our key, and with theirs, as a program would that holds the key.
    for (key, manifest) in [("theirs", "a"), ("zero", "b")] {
        let command = format!("pkeyutl -sign -inkey {key}.pem -rawin -in tbs.bin -out tbs.sig");
        assert_eq!(openssl(path, &command), Some(true));
        let public = format!("{key}.pub.pem");
        let with = [
            "--signature",
            "tbs.sig",
            "--public-key",
            &public,
            "-o",
            "c.manifest",
        ];
        assert_made(sign(&with));
        let made = format!("{manifest}.manifest");
        let [ours, theirs] = [made.as_str(), "c.manifest"].map(|file| fs::read(path.join(file)));
        assert_eq!(
            ours.unwrap(),
            theirs.unwrap(),
            "a signature is what the key says, whoever makes it"
        );
    }
    assert_eq!(
        openssl(
            path,
            "pkey -in zero.pem -aes256 -passout pass:x -out locked.pem"
        ),
        Some(true)
    );
    sign(&["--key", "locked.pem"])
        .assert_code(2)
        .assert_says(&["encrypted"]);
}
