//! `ray-runtime/c/rays_device.h`: two slots over callbacks, and the gaps of a C program's own measurements. The example gives what Rust
//! gives, on the host and on Arm in QEMU; and power is cut at every operation of an update, on many kinds of flash.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use ray_device::health::Health;
use ray_runtime::{Aligned, PixelPoint, RayBlob};

use super::c_build::{
    CORTEX_M0, CORTEX_M4F, WARNINGS, build_for_host, c_folder, made, root, succeed,
};

static BLOB: &Aligned<[u8]> = &Aligned(*include_bytes!("../../../data/golden/stereo-v3-fast.rays"));

fn blob_file() -> std::path::PathBuf {
    root().join("data/golden/stereo-v3-fast.rays")
}

/// What `example_device.c` must print.
fn expected() -> String {
    let length = BLOB.0.len();
    let mut text = "blank: 000000a2 00000000 nowhere\n".to_owned();
    // The slots take turns: three updates and two rollbacks.
    for (slot, act) in [
        (0, "update"),
        (1, "update"),
        (0, "update"),
        (1, "rollback"),
        (0, "rollback"),
    ] {
        writeln!(text, "{act}: 00000000 ").unwrap();
        writeln!(text, "restart: 00000000 {length:08x} wanted in slot {slot}").unwrap();
    }
    let rig = RayBlob::open(&BLOB.0).unwrap();
    let mut state = 1u32;
    let mut next_px = |extent_px: u32| {
        state = state.wrapping_mul(1664525).wrapping_add(1013904223);
        ((state >> 8) % ((extent_px + 1) << 14)) as f32 / 16384.0 - 1.0
    };
    let mut health = Health::new();
    for _ in 0..4000 {
        let [a, b, c, d] = [64, 48, 64, 48].map(&mut next_px);
        let (first, second) = (PixelPoint::new(a, b), PixelPoint::new(c, d));
        if let Ok(measured) = rig.triangulate_with_covariance((0, first), (1, second)) {
            health.note(&measured);
        }
    }
    let report = health.report().unwrap();
    let predicted = report.predicted.unwrap();
    let verdict = report.verdict() as u32;
    assert!(report.points > 1000, "only {} points", report.points);
    let words = [
        verdict,
        report.points,
        report.mean_signed_mm.to_bits(),
        report.mean_size_mm.to_bits(),
        report.within_95_mm.to_bits(),
        predicted.points,
        predicted.mean_sigma_mm.to_bits(),
        predicted.shift.to_bits(),
        predicted.spread.to_bits(),
    ];
    let words = words.map(|word| format!("{word:08x} ")).concat();
    text + &format!("gaps {words}\n")
}

fn compile(sources: &[&Path], name: &str) -> std::path::PathBuf {
    let library = build_for_host(&format!("lib{name}.a"), &[]);
    let program = made(name);
    let mut command = Command::new("cc");
    command.args(["-std=c99", "-O2", "-I."]).args(WARNINGS);
    command.args(sources).arg(library).arg("-o").arg(&program);
    succeed(command.current_dir(c_folder()));
    program
}

#[test]
fn the_device_example_gives_what_rust_gives_on_the_host() {
    let program = compile(
        &[Path::new("example_device.c"), Path::new("host.c")],
        "example-device",
    );
    let printed = succeed(Command::new(program).arg(blob_file()));
    assert_eq!(printed, expected());
}

#[test]
fn the_device_example_gives_what_rust_gives_on_arm() {
    for arm in [CORTEX_M4F, CORTEX_M0] {
        if let Some(image) = arm.build("example-device", &["example_device.c", "qemu.c"]) {
            assert_eq!(arm.run(&image, &blob_file()), expected());
        }
    }
}

#[test]
fn cuts_of_power_leave_the_old_or_the_new_blob_behind_callbacks() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/c_storage.c");
    let program = compile(&[&source], "c-storage");
    let golden = root().join("data/golden");
    let printed = succeed(
        Command::new(program)
            .arg(golden.join("stereo-v3-small.rays"))
            .arg(golden.join("stereo-v3-fast.rays")),
    );
    let cuts: u32 = printed
        .lines()
        .filter_map(|line| line.rsplit_once(' ')?.1.parse::<u32>().ok())
        .sum();
    println!("{printed}");
    assert!(printed.ends_with("all as it should be\n"), "{printed}");
    assert!(cuts > 3000, "only {cuts} cuts");
}
