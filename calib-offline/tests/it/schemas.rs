//! What every help says of its `--json` objects is what they hold. The objects of `methods`, `evaluate`
//! and `detect --target` are compared where tests make them.

use crate::common::documented::{assert_documented, assert_listed};
use crate::common::{MANIFEST, corners_csv, dataset, run};
use firmware_sim::simulated::host::SimulatedDevice;
use serde_json::Value;
use std::fs;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let run = run(folder, &[arguments, &["--json"]].concat());
    // A verdict of such small recordings may be fail.
    assert!(run.code <= 1, "{arguments:?}: {}", run.stderr);
    run.json()
}

/// A recording with matches whose truth is known, as small as one can be held out from.
const SIMULATE: [&str; 16] = [
    "simulate",
    "-o",
    "data/stage",
    "--optics",
    "port",
    "--seed",
    "3",
    "--rows",
    "7",
    "--cols",
    "6",
    "--square-mm",
    "22",
    "--angles=-30:15:30",
    "--points=50",
    "--holdout=50",
];

#[test]
fn from_a_recording_to_points() {
    let home = dataset(MANIFEST, corners_csv(6).as_bytes());
    let path = home.path();
    let measure = "id,u_left,v_left,u_right,v_right\na,320,240,320,240\nb,330,250,330,250\n";
    fs::write(path.join("matches.csv"), measure).unwrap();
    fs::write(path.join("lengths.csv"), "id_a,id_b,length_mm\na,b,9\n").unwrap();

    let task = ["--task", "length 20 mm at 500 mm"];
    let calibrated = json(
        path,
        &[&["calibrate", "set", "-o", "out"][..], &task].concat(),
    );
    assert_documented("calibrate", "calib-offline/calibrate/1", &[calibrated], &[]);
    for (file, kind) in [
        ("set", "dataset"),
        ("out/calibration.json", "calibration"),
        ("out/rig.rays", "blob"),
    ] {
        let schema = format!("kind {kind} of schema calib-offline/inspect/1");
        let keys = ["dial.counterclockwise", "dial.largest_deg", "dial.rms_deg"];
        let never = keys.map(|key| (key, "there is no stage"));
        let never = if kind == "dataset" { &never[..] } else { &[] };
        assert_documented("inspect", &schema, &[json(path, &["inspect", file])], never);
    }
    let compare = ["compare", "out/calibration.json", "out/calibration.json"];
    let compared = json(path, &compare);
    assert_documented("compare", "calib-offline/compare/2", &[compared], &[]);
    let packed = json(path, &["pack", "out/calibration.json", "-o", "new.rays"]);
    assert_documented("pack", "calib-offline/pack/2", &[packed], &[]);
    let export = ["export", "new.rays", "-o", "rig.c", "--format", "c"];
    let exported = json(path, &export);
    let export = ["export", "new.rays", "-o", "opencv", "--format", "opencv"];
    let mesh = ["export", "new.rays", "-o", "ldc", "--format", "mesh-ti"];
    let table = "id,x,y,z,gap,sigma_x,sigma_y,sigma_z,status\na,1,2,3,0,,,,ok\n";
    fs::write(path.join("table.csv"), table).unwrap();
    let slot = "export new.rays -o slot.hex --format slot-image --part rp2040 --region-address 0x10100000 --region-size 0x40000";
    let slot: Vec<&str> = slot.split(' ').collect();
    let clouds = ["export", "table.csv", "-o", "cloud.ply", "--format", "ply"];
    let exported = [
        exported,
        json(path, &export),
        json(path, &mesh),
        json(path, &slot),
        json(path, &clouds),
    ];
    assert_documented("export", "calib-offline/export/1", &exported, &[]);
    fs::write(path.join("pixels.csv"), "id,u,v\na,320,240\n").unwrap();
    let rays = ["rays", "new.rays", "pixels.csv", "--camera", "left"];
    let looked_up = json(path, &[&rays[..], &["-o", "rays.csv"]].concat());
    assert_documented("rays", "calib-offline/rays/1", &[looked_up], &[]);
    let measure = ["measure", "new.rays", "matches.csv", "-o", "points.csv"];
    let lengths = ["--lengths", "lengths.csv"];
    let measured = json(path, &[measure.as_slice(), &lengths].concat());
    // Nothing was estimated; `match_noise` compares an object in which it was.
    assert_listed("measure", "calib-offline/measure/1", &[measured]);
}

#[test]
fn of_the_demo_and_what_it_is_run_on() {
    let home = dataset(MANIFEST, corners_csv(6).as_bytes());
    let path = home.path();
    fs::create_dir(path.join("data")).unwrap();
    fs::rename(path.join("set"), path.join("data/opencv-stereo")).unwrap();
    let simulated = json(path, &SIMULATE);
    assert_documented("simulate", "calib-offline/simulate/1", &[simulated], &[]);
    let object = json(path, &["demo", "--data", "data"]);
    assert_documented("demo", "calib-offline/demo/1", &[object], &[]);
}

#[test]
fn of_images() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path();
    let simulate = [
        "simulate",
        "-o",
        "set",
        "--images",
        "--sensor",
        "640x480",
        "--rows",
        "7",
        "--cols",
        "6",
        "--square-mm",
        "14",
        "--spread=0.3",
        "--angles=-20:10:20",
        "--placements=1",
    ];
    run(path, &simulate).assert_code(0);
    let object = json(path, &["detect", "set"]);
    let in_order = "every image of a simulated recording has the board the same way up";
    assert_documented(
        "detect",
        "calib-offline/detect/1",
        &[object],
        &["turned.camera", "turned.pose", "turned.quarter_turns"].map(|key| (key, in_order)),
    );
}

#[test]
fn of_devices() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden");
    let home = tempfile::tempdir().unwrap();
    let path = home.path();
    let device = SimulatedDevice::start(SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), &[]).unwrap();
    let address = format!("tcp:{}", device.address());
    let there = ["--device", &address];
    let small = data.join("stereo-v3-small.rays");
    let fast = data.join("stereo-v3-fast.rays");
    let flash = |file: &Path| {
        json(
            path,
            &[&["flash", file.to_str().unwrap()], &there[..]].concat(),
        )
    };
    let flashed = [flash(&small), flash(&fast)];
    assert_documented("flash", "calib-offline/flash/1", &flashed, &[]);

    let matches = "id,u_left,v_left,u_right,v_right\na,30,20,30,20\nb,30,22,28,22\n";
    fs::write(path.join("matches.csv"), matches).unwrap();
    let measure = ["measure", "matches.csv", "-o", "points.csv"];
    let measured = json(path, &[&measure[..], &there].concat());
    assert_listed("measure", "calib-offline/measure/1", &[measured]);

    let device = |verb: &str| json(path, &[&["device", verb], &there[..]].concat());
    let owned = "a device that was built with its cameras";
    let under_way = "a transfer that was broken off";
    let signed = "a device with an owner";
    assert_documented(
        "device",
        "calib-offline/device-status/1",
        &[device("status")],
        &[
            ("rig.serial", owned),
            ("rig.cameras", owned),
            ("rig.cameras.name", owned),
            ("rig.cameras.width_px", owned),
            ("rig.cameras.height_px", owned),
            ("slots.open_error", "a blob that was damaged in its slot"),
            ("update.identity", under_way),
            ("update.bytes", under_way),
            ("update.received_bytes", under_way),
            ("owner.keys", signed),
            ("owner.newest_version", signed),
            ("owner.least_version", signed),
            ("owner.retired_below", signed),
        ],
    );
    let tested = device("selftest");
    assert_documented("device", "calib-offline/device-selftest/1", &[tested], &[]);
    let back = device("rollback");
    assert_documented("device", "calib-offline/device-rollback/1", &[back], &[]);
}
