//! `flash`, `device` and `measure --device`, driven as a user drives them: the real binary against the
//! simulated device.

use crate::common::{Run, contents, run};
use firmware_sim::simulated::flash_file;
use firmware_sim::simulated::host::SimulatedDevice;
use ray_runtime::{Aligned, PixelPoint, RayBlob};
use std::fmt::Write as _;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::Path;
use std::thread;

static SMALL: &Aligned<[u8]> =
    &Aligned(*include_bytes!("../../../data/golden/stereo-v3-small.rays"));
static FAST: &Aligned<[u8]> = &Aligned(*include_bytes!("../../../data/golden/stereo-v3-fast.rays"));

/// A device with this in its flash, and its address as the command line takes it.
fn device(blob: &[u8]) -> (SimulatedDevice, String) {
    let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let device = SimulatedDevice::start(any_port, blob).unwrap();
    let address = format!("tcp:{}", device.address());
    (device, address)
}

/// A folder with `small.rays` and `fast.rays`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("small.rays"), &SMALL.0).unwrap();
    fs::write(folder.path().join("fast.rays"), &FAST.0).unwrap();
    folder
}

fn ask(folder: &Path, address: &str, verb: &str) -> Run {
    run(folder, &["device", "--device", address, verb])
}

/// Matches of points in front of both cameras, those of the second camera moved by so many rows.
fn write_matches(path: &Path, moved_px: f32) -> usize {
    let blob = RayBlob::open(&SMALL.0).unwrap();
    let mut text = "id,u_left,v_left,u_right,v_right\n".to_owned();
    let mut count = 0;
    for k in 0..4000_u16 {
        let pixel = PixelPoint::new(f32::from(k % 61) + 1.25, f32::from(k / 61 % 45) + 1.5);
        let Ok(ray) = blob.lookup(0, pixel) else {
            continue;
        };
        let along = 200.0 + f32::from(k % 7) * 50.0;
        let point_mm = [0, 1, 2].map(|axis| ray.origin_mm[axis] + ray.direction[axis] * along);
        if let Ok(seen) = blob.project(1, point_mm) {
            let [u, v] = [seen.u, seen.v + moved_px];
            let _ = writeln!(text, "{k},{},{},{u},{v}", pixel.u, pixel.v);
            count += 1;
        }
    }
    fs::write(path, text).unwrap();
    count
}

#[test]
fn a_blob_is_flashed_rolled_back_and_measured_with_the_hosts_bits() {
    let folder = folder();
    let path = folder.path();
    let (_device, address) = device(&[]);
    ask(path, &address, "status")
        .assert_code(0)
        .assert_prints(&["measures nothing", "calib-offline flash", "slot 0: empty"]);
    let matches = path.join("m.csv");
    assert!(write_matches(&matches, 0.0) > 500);
    let measure = ["measure", "--device", &address, "m.csv", "-o", "device.csv"];
    run(path, &measure)
        .assert_code(2)
        .assert_says(&["no blob it can measure with", "calib-offline flash"]);
    assert!(!path.join("device.csv").exists());
    ask(path, &address, "selftest").assert_code(2);
    ask(path, &address, "rollback")
        .assert_code(2)
        .assert_says(&["holds no whole blob"]);

    for blob in ["small", "fast"] {
        let file = format!("{blob}.rays");
        run(path, &["flash", &file, "--device", &address])
            .assert_code(0)
            .assert_prints(&["is in use on the device"]);
        run(path, &["flash", &file, "--device", &address])
            .assert_code(0)
            .assert_prints(&["already", "nothing was sent"]);
        ask(path, &address, "selftest")
            .assert_code(0)
            .assert_prints(&["self-tests gave the bits of the host"]);
        run(path, &measure).assert_code(0);
        run(path, &["measure", &file, "m.csv", "-o", "host.csv"]).assert_code(0);
        let [there, here] = ["device.csv", "host.csv"].map(|name| fs::read(path.join(name)));
        assert_eq!(there.unwrap(), here.unwrap(), "{file}");
    }
    ask(path, &address, "rollback")
        .assert_code(0)
        .assert_prints(&["is in use again"]);
    run(path, &measure).assert_code(0);
    run(path, &["measure", "small.rays", "m.csv", "-o", "host.csv"]).assert_code(0);
    let [there, here] = ["device.csv", "host.csv"].map(|name| fs::read(path.join(name)).unwrap());
    assert_eq!(there, here, "the first blob is in use again");
}

/// A self-test that tested nothing is no good news.
#[test]
fn a_blob_without_self_tests_for_integers_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let integers: &[u8] = include_bytes!("../../../data/golden/stereo-v4-integer-small.rays");
    for (blob, has_tests) in [(&SMALL.0, false), (integers, true)] {
        let flash = flash_file::holding(blob, None).unwrap();
        let device = SimulatedDevice::start_in_integers(any_port, flash).unwrap();
        let address = format!("tcp:{}", device.address());
        let run = ask(path, &address, "selftest");
        let json = run_json(path, &address);
        if has_tests {
            run.assert_code(0).assert_prints(&["gave the bits"]);
            json.assert_code(0);
            assert_ne!(json.json()["tests"], 0);
        } else {
            run.assert_code(3).assert_prints(&[
                "nothing was tested",
                "no self-tests for integers",
                "pack --arithmetic integer",
            ]);
            json.assert_code(3);
            assert_eq!(json.json()["tests"], 0);
        }
    }
}

fn run_json(path: &Path, address: &str) -> Run {
    run(path, &["device", "--device", address, "selftest", "--json"])
}

#[test]
fn the_status_says_whether_the_calibration_still_fits() {
    let folder = folder();
    let path = folder.path();
    let (_device, address) = device(&SMALL.0);
    let measure = ["measure", "--device", &address, "m.csv", "-o", "p.csv"];
    ask(path, &address, "status")
        .assert_code(0)
        .assert_prints(&["not known yet"]);
    write_matches(&path.join("m.csv"), 0.0);
    run(path, &measure).assert_code(0);
    ask(path, &address, "status")
        .assert_code(0)
        .assert_prints(&["still fits", "only known lengths show that"]);
    // The second camera was knocked upwards and sees everything two rows lower; the blob, which does not
    // know, has its rays pass below.
    write_matches(&path.join("m.csv"), 2.0);
    for _ in 0..5 {
        run(path, &measure).assert_code(0);
    }
    ask(path, &address, "status")
        .assert_code(1)
        .assert_prints(&["no longer fits", "calibrate again", "mm"]);
    let json = run(path, &["device", "status", "--device", &address, "--json"]);
    let object: serde_json::Value = serde_json::from_str(&json.stdout).unwrap();
    assert_eq!(object["schema"], "calib-offline/device-status/1");
    assert_eq!(object["gaps"]["verdict"], "shifted");
    assert!(object["gaps"]["mean_signed_mm"].as_f64().unwrap() < -0.1);
    assert_eq!(object["blob"]["cameras"][1]["name"], "right");
    assert_eq!(object["slots"][0]["state"], "holds");
}

/// An address where nobody listens: a port that was taken, and given back.
fn nobody() -> String {
    let (_listener, address) = listener();
    address
}

fn listener() -> (TcpListener, String) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    (listener, address)
}

#[test]
fn whoever_does_not_answer_as_a_device_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let (_silent, silent) = listener();
    let (other, something_else) = listener();
    let talker = thread::spawn(move || {
        let (mut stream, _) = other.accept().unwrap();
        let answer = b"HTTP/1.1 400 Bad Request\r\n\r\n";
        stream.write_all(answer).unwrap();
        // Until the other side has gone; how, is all the same.
        let _ = stream.read_to_end(&mut Vec::new());
    });
    let cases: [(&str, &[&str]); 5] = [
        (&nobody(), &["nothing listens there", "firmware-sim host"]),
        (&silent, &["no answer", "within 2 s"]),
        (
            &something_else,
            &["no device of this kind", "is the address right"],
        ),
        ("usb:3", &["no device address"]),
        ("tcp:localhost", &["no device address"]),
    ];
    for (address, said) in cases {
        let arguments = ["device", "--device", address, "--timeout", "2", "status"];
        run(folder.path(), &arguments)
            .assert_code(2)
            .assert_says(said);
    }
    talker.join().unwrap();
}

#[test]
fn what_cannot_be_done_is_said_and_nothing_is_written() {
    let folder = folder();
    let path = folder.path();
    let (_device, address) = device(&SMALL.0);
    write_matches(&path.join("m.csv"), 0.0);
    fs::write(path.join("c.json"), "{}").unwrap();
    fs::write(path.join("cut.rays"), &SMALL.0[..2000]).unwrap();
    let mut wide = "id,u_left,v_left,u_right,v_right\n".to_owned();
    wide += "a,1,2,3,4\nb,1,2,x,4\n";
    fs::write(path.join("bad.csv"), wide).unwrap();
    let nobody = nobody();

    let before = contents(path);
    let cases: &[(&[&str], &[&str])] = &[
        (
            &["device", "status"],
            &["--device is missing", "tcp:127.0.0.1:7777"],
        ),
        (&["flash", "c.json", "--device", &address], &["c.json"]),
        (
            &["flash", "cut.rays", "--device", &address],
            &["cut.rays", "cut off"],
        ),
        (
            &["flash", "none.rays", "--device", &address],
            &["none.rays: does not exist"],
        ),
        (
            &["flash", "small.rays", "--device", &nobody, "--retries", "0"],
            &["nothing listens there"],
        ),
        (
            &["measure", "--device", &address, "bad.csv", "-o", "p.csv"],
            &["bad.csv:3: \"x\" is not a pixel coordinate"],
        ),
        (
            &[
                "measure",
                "--device",
                &address,
                "small.rays",
                "m.csv",
                "-o",
                "p.csv",
            ],
            &["cannot be used with"],
        ),
        (
            &[
                "measure", "--device", &address, "m.csv", "-o", "p.csv", "--frame", "left",
            ],
            &["cannot be used with"],
        ),
        (&["measure", "m.csv", "-o", "p.csv"], &["RIG"]),
        (
            &["measure", "--device", &address, "m.csv", "-o", "m.csv"],
            &["is what the command reads"],
        ),
    ];
    for (arguments, said) in cases {
        run(path, arguments).assert_code(2).assert_says(said);
        assert_eq!(contents(path), before, "{arguments:?}");
    }

    // The device is as it was.
    ask(path, &address, "status")
        .assert_code(0)
        .assert_prints(&["up for", "0 updates"]);
}
