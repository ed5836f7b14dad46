//! `export`, driven as a user drives it: the real binary on a golden blob.

use crate::common::{contents, run};
use std::fs;
use std::path::Path;
use std::process::Command;

/// A folder with the blob `rig.rays`.
fn folder() -> (tempfile::TempDir, Vec<u8>) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden/stereo-v3-small.rays");
    let blob = fs::read(golden).unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("rig.rays"), &blob).unwrap();
    (folder, blob)
}

const HEX: [&str; 8] = [
    "export",
    "rig.rays",
    "-o",
    "rig.out",
    "--format",
    "hex",
    "--base-address",
    "0x08100000",
];

const REGION: [&str; 5] = [
    "rig.rays",
    "--format",
    "slot-image",
    "--region-size",
    "0x10000",
];
const RP2040: [&str; 5] = ["rig.rays", "--format", "uf2", "--family", "rp2040"];

#[test]
fn every_form_is_written_and_said() {
    let (folder, blob) = folder();
    let path = folder.path();
    let written = |arguments: &[&str], name: &str| {
        let all = [&["export", "rig.rays", "-o", name, "--format"], arguments].concat();
        let run = run(path, &all);
        run.assert_code(0);
        assert!(run.stdout.contains(name), "{}", run.stdout);
        fs::read(path.join(name)).unwrap()
    };
    assert_eq!(written(&["bin"], "rig.bin"), blob);
    let hex = written(&["hex", "--base-address", "0x08100000"], "rig.hex");
    assert!(hex.starts_with(b":020000040810E2\n:10000000"));
    let uf2 = ["uf2", "--base-address", "269484032", "--family", "rp2040"];
    let uf2 = written(&uf2, "rig.uf2");
    assert_eq!(uf2.len(), blob.len().div_ceil(4096) * 8192);
    assert_eq!(uf2[28..32], 0xe48b_ff56_u32.to_le_bytes());
    assert_eq!(uf2[32..288], blob[..256]);
    let source = String::from_utf8(written(&["c", "--name", "my_rig"], "rig.c")).unwrap();
    assert!(source.contains(&format!("my_rig_len = {};", blob.len())));
    written(&["c"], "default.c");

    // An earlier file of the same form is replaced, nothing else.
    written(&["hex", "--base-address", "8"], "rig.hex");
    for form in ["uf2", "hex"] {
        let onto = ["export", "rig.rays", "-o", "rig.c", "--format", form];
        let onto = [&onto[..], &["--base-address", "0"]].concat();
        run(path, &onto)
            .assert_code(2)
            .assert_says(&["rig.c: exists", "--force"]);
        assert!(fs::read(path.join("rig.c")).unwrap().starts_with(b"/*"));
    }
    run(
        path,
        &["export", "rig.rays", "-o", "rig.rays", "--format", "bin"],
    )
    .assert_code(2)
    .assert_says(&["is what the command reads"]);
}

#[test]
fn the_c_source_compiles_to_the_blob() {
    let (folder, blob) = folder();
    let path = folder.path();
    run(
        path,
        &["export", "rig.rays", "-o", "rig.c", "--format", "c"],
    )
    .assert_code(0);
    let main = "#include <stddef.h>\n#include <stdint.h>\n#include <stdio.h>\n\
        extern const uint8_t rays_blob[];\nextern const size_t rays_blob_len;\n\
        int main(void) { fwrite(rays_blob, 1, rays_blob_len, stdout); return (uintptr_t)rays_blob % 8 != 0; }\n";
    fs::write(path.join("main.c"), main).unwrap();
    let compiled = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"])
        .args(["rig.c", "main.c", "-o", "program"])
        .current_dir(path)
        .output()
        .expect("a C compiler, which Rust links with, too");
    let said = String::from_utf8_lossy(&compiled.stderr);
    assert!(compiled.status.success(), "{said}");
    let output = Command::new(path.join("program")).output().unwrap();
    assert!(output.status.success());
    assert_eq!(output.stdout, blob);
}

#[test]
fn json_says_what_was_written() {
    let (folder, blob) = folder();
    let run = run(folder.path(), &[&HEX[..], &["--json"]].concat());
    run.assert_code(0);
    let object = run.json();
    assert_eq!(object["schema"], "calib-offline/export/1");
    assert_eq!(object["format"], "hex");
    assert_eq!(object["output"], "rig.out");
    assert_eq!(object["blob_bytes"], blob.len());
    let file_len = fs::metadata(folder.path().join("rig.out")).unwrap().len();
    assert_eq!(object["file_bytes"], file_len);
    assert_eq!(object["base_address"], 0x0810_0000);
    assert!(object["family"].is_null() && object["name"].is_null());
}

const SLOT: [&str; 12] = [
    "export",
    "rig.rays",
    "--format",
    "slot-image",
    "--part",
    "stm32h743",
    "--region-address",
    "0x08120000",
    "--region-size",
    "0xe0000",
    "-o",
    "slot.out",
];

/// Whether a device starts with it is tested beside the simulated device, for every part.
#[test]
fn an_image_of_a_slot_is_written_in_every_container() {
    let (folder, blob) = folder();
    let path = folder.path();
    let written = |more: &[&str]| {
        let run = run(path, &[&SLOT[..], more, &["--force", "--json"]].concat());
        run.assert_code(0);
        (fs::read(path.join("slot.out")).unwrap(), run.json())
    };
    let (bin, object) = written(&["--container", "bin"]);
    // Behind the factory's block, a log of 256 entries of 96 bytes, then the blob.
    assert_eq!(object["base_address"], 0x0814_0000);
    assert_eq!(object["slot"]["blob_address"], 0x0814_6000);
    assert_eq!(bin[0x6000..][..blob.len()], blob);
    assert!(bin.starts_with(b"RayD"));
    let (hex, object) = written(&["--slot", "1"]);
    assert!(hex.starts_with(b":02000004081AD8\n:10000000526179"));
    assert_eq!(object["slot"]["container"], "hex");
    assert!(hex.len() < 4 * blob.len());
    let by_hand = [
        "export",
        "rig.rays",
        "--format",
        "slot-image",
        "--unit",
        "1",
        "--block",
        "4096",
        "--region-address",
        "0x10100000",
        "--region-size",
        "0x10000",
        "--container",
        "uf2",
        "--family",
        "rp2040",
        "--serial",
        "SN-0012",
        "-o",
        "slot.uf2",
    ];
    let by_hand = run(path, &by_hand);
    by_hand.assert_code(0).assert_says(&[]);
    let uf2 = fs::read(path.join("slot.uf2")).unwrap();
    // Factory block, log, blob.
    assert_eq!(uf2.len(), 3 * 16 * 512);
    assert_eq!(uf2[32..36], *b"RigF");
    assert_eq!(uf2[32 * 512 + 32..][..256], blob[..256]);
}

#[test]
fn what_a_reader_of_the_file_should_know_is_said() {
    let (folder, _) = folder();
    let mut hex = HEX;
    hex[7] = "0x90000000";
    let high = run(folder.path(), &hex);
    high.assert_code(0);
    assert!(high.stdout.contains("take bin"), "{}", high.stdout);
    let place = ["--base-address", "0x10100000", "-o", "rig.uf2"];
    let written = run(folder.path(), &[&["export"], &RP2040[..], &place].concat());
    written.assert_code(0);
    assert!(
        written.stdout.contains("4096 bytes are written"),
        "{}",
        written.stdout
    );
}

#[allow(clippy::too_many_lines, reason = "a table")]
#[test]
fn wrong_requests_write_nothing() {
    let (folder, blob) = folder();
    let path = folder.path();
    let mut damaged = blob.clone();
    damaged[blob.len() / 2] ^= 4;
    fs::write(path.join("damaged.rays"), damaged).unwrap();
    fs::write(path.join("short.rays"), &blob[..blob.len() - 8]).unwrap();
    fs::write(path.join("text.rays"), "left,right\n").unwrap();
    fs::write(path.join("calibration.json"), "{}").unwrap();
    let before = contents(path);
    let cases: [(&[&str], &[&str]); 24] = [
        (&["damaged.rays", "--format", "bin"], &["damaged", "try: "]),
        (&["short.rays", "--format", "bin"], &["cut off", "try: "]),
        (&["text.rays", "--format", "bin"], &["text.rays: is not"]),
        (
            &["calibration.json", "--format", "bin"],
            &["calibration.json"],
        ),
        (&["none.rays", "--format", "bin"], &["does not exist"]),
        (&["rig.rays"], &["--format"]),
        (&["rig.rays", "--format", "elf"], &["elf", "uf2"]),
        (
            &["rig.rays", "--format", "hex"],
            &["hex needs a base address", "--base-address"],
        ),
        (
            &["rig.rays", "--format", "hex", "--base-address", "0x8100004"],
            &["0x8100004 is not a multiple of 8"],
        ),
        (
            &["rig.rays", "--format", "uf2", "--base-address", "0x8000008"],
            &["0x8000008 is not a multiple of 256"],
        ),
        (
            &[
                "rig.rays",
                "--format",
                "uf2",
                "--base-address",
                "0x10100000",
            ],
            &["names no family", "--family rp2040"],
        ),
        (
            &[&RP2040[..], &["--base-address", "0x10100100"]].concat(),
            &["sector of 4096", "--base-address 0x10101000, or 0x10100000"],
        ),
        (
            &[&RP2040[..], &["--base-address", "0x20000000"]].concat(),
            &["not in the flash of rp2040", "0x10000000 to 0x10ffffff"],
        ),
        (
            &[
                &RP2040[..],
                &["--base-address", "0x10100000", "--absolute-block"],
            ]
            .concat(),
            &["only families of the RP2350", "leave --absolute-block out"],
        ),
        (
            &["rig.rays", "--format", "uf2", "--family", "rp2041"],
            &["rp2041", "0xe48bff56", "rp2350-arm-s"],
        ),
        (
            &[
                "rig.rays",
                "--format",
                "hex",
                "--base-address",
                "0xfffffff8",
            ],
            &["beyond the last address"],
        ),
        (
            &["rig.rays", "--format", "hex", "--base-address", "flash"],
            &["0x10100000"],
        ),
        (
            &["rig.rays", "--format", "slot-image", "--part", "stm32h743"],
            &["slot-image needs --region-address", "firmware"],
        ),
        (
            &[&REGION[..], &["--region-address", "0"]].concat(),
            &["slot-image needs --part, or --unit and --block"],
        ),
        (
            &[&REGION[..], &["--region-address", "4", "--part", "rp2040"]].concat(),
            &["not made of blocks of 4096"],
        ),
        (
            &[&REGION[..], &["--region-address", "0", "--part", "stm33"]].concat(),
            &["stm33", "stm32h743", "--unit"],
        ),
        (
            &["rig.rays", "--format", "bin", "--part", "rp2040"],
            &["bin has no place for --part"],
        ),
        (
            &["rig.rays", "--format", "bin", "--name", "rig"],
            &["bin has no place for --name"],
        ),
        (
            &["rig.rays", "--format", "c", "--name", "2 rigs"],
            &["\"2 rigs\" is no name", "--name"],
        ),
    ];
    for (arguments, words) in cases {
        let all = [&["export", "-o", "new.out"], arguments].concat();
        run(path, &all).assert_code(2).assert_says(words);
        assert_eq!(contents(path), before, "{arguments:?}");
    }
}

#[test]
fn help_starts_with_an_example() {
    let folder = tempfile::tempdir().unwrap();
    let help = run(folder.path(), &["export", "--help"]);
    help.assert_code(0);
    assert!(
        help.stdout
            .starts_with("Example:\n  calib-offline export rig.rays"),
        "{}",
        help.stdout
    );
}
