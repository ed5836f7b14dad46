//! `firmware-sim cost`, and the proof on which its claim of no panic rests.
//!
//! Needs QEMU and a bare-metal toolchain; where they are missing these tests fail and name what to
//! install. `tests/run` installs them first.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use firmware_cost as cost;
use firmware_sim::simulated::qemu;
use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firmware-sim"));
    command.arg("cost").args(arguments).output().unwrap()
}

/// Standard output, which must be one JSON object and nothing else.
fn counted(arguments: &[&str]) -> Value {
    let output = run(&[&["--json"], arguments].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn rows<'a>(blob: &'a Value, work: &'a str) -> impl Iterator<Item = &'a Value> {
    let rows = blob["rows"].as_array().unwrap().iter();
    rows.filter(move |row| row["work"] == work)
}

fn most(blob: &Value, work: &str) -> i64 {
    let most = rows(blob, work).map(|row| row["instructions"]["max"].as_i64().unwrap());
    most.max().unwrap_or_else(|| panic!("no row {work}"))
}

#[test]
fn counts_are_exact_and_the_same_in_every_run() {
    let first = counted(&[]);
    let second = counted(&[]);
    assert_eq!(first, second);
    assert_eq!(first["schema"], cost::SCHEMA);
    // Counted in the image; 100 `nop` stand in its source.
    assert_eq!(first["conditions"]["known_block_counted"], 100);

    let blobs = first["blobs"].as_array().unwrap();
    assert_eq!(blobs.len(), cost::built_in().len());
    for blob in blobs {
        assert!(blob["matches"].as_u64().unwrap() >= 64);
        assert_eq!(rows(blob, "lookup").count(), 2);
        for row in blob["rows"].as_array().unwrap() {
            let is_per_match = !matches!(
                row["work"].as_str(),
                Some("open" | "checksum" | "integer_prepare")
            );
            let runs = row["runs"].as_u64().unwrap();
            assert!(
                runs > 0 && (row["is_yardstick"] == true || !is_per_match || runs == 64),
                "{row}"
            );
            let [min, max] = ["min", "max"].map(|key| row["instructions"][key].as_i64().unwrap());
            let mean = row["instructions"]["mean"].as_f64().unwrap();
            assert!(0 < min && min as f64 <= mean && mean <= max as f64, "{row}");
            // What was seen on the stack cannot be more than the bound says.
            let bound = row["stack_bound"]["bytes"].as_u64();
            assert!(row["stack_bytes"].as_u64() <= bound, "{row}");
            assert!(bound.is_some(), "{row}");
        }
        // Each is a part of the next.
        assert!(most(blob, "lookup") < most(blob, "triangulate"));
        assert!(most(blob, "checksum") < most(blob, "open"));
        assert!(most(blob, "bilinear_lookup") < most(blob, "bilinear_triangulate"));
        assert!(most(blob, "brown_undistortion") < most(blob, "brown_triangulate"));
        if rows(blob, "integer_triangulate").next().is_some() {
            assert!(most(blob, "integer_lookup_fixed") < most(blob, "integer_triangulate_fixed"));
            assert!(most(blob, "integer_triangulate_fixed") < most(blob, "integer_triangulate"));
        }
        if rows(blob, "triangulate_with_covariance").next().is_some() {
            assert!(most(blob, "triangulate") < most(blob, "triangulate_with_covariance"));
        }
        // A table-driven CRC-32 takes at least a load, a shift, an index and an exclusive or.
        assert!(blob["checksum_instructions_per_byte"].as_f64().unwrap() >= 4.0);
    }
    let integers = blobs
        .iter()
        .flat_map(|blob| rows(blob, "integer_triangulate"));
    assert!(integers.count() > 0, "no blob was counted in integers");
    let covariances = blobs
        .iter()
        .flat_map(|blob| rows(blob, "triangulate_with_covariance"));
    assert!(
        covariances.count() > 0,
        "no blob with uncertainty was counted"
    );

    check_images(first["images"].as_array().unwrap());
}

fn check_images(images: &[Value]) {
    assert_eq!(images.len(), 3);
    for image in images {
        assert_eq!(image["panics"], Value::Array(Vec::new()), "{image}");
        let name = image["image"].as_str().unwrap();
        let bounds = image["stack_bounds"].as_object().unwrap();
        for (function, bound) in bounds {
            assert!(
                bound["bytes"].as_u64() > Some(0),
                "{name} {function}: {bound}"
            );
        }
        let origins = image["code_by_origin"].as_object().unwrap();
        let code: u64 = origins.values().filter_map(Value::as_u64).sum();
        let text = image["sections"][".text"].as_u64().unwrap();
        // What has no symbol is padding between functions and a few empty handlers.
        assert!(
            code <= text && text - code < 200,
            "{name}: {code} of {text}"
        );
        if name.starts_with("footprint") {
            assert_eq!(image["ram_besides_stack"], 0, "{name}");
            assert!(
                image["runtime_code_bytes"].as_u64().unwrap() < code,
                "{name}"
            );
        }
    }
}

#[test]
fn a_blob_can_be_handed_in_and_the_tables_say_the_same() {
    let file = root().join("data/golden/stereo-v2.rays");
    let arguments = ["--blob", file.to_str().unwrap()];
    let cost = counted(&arguments);
    let [blob] = cost["blobs"].as_array().unwrap().as_slice() else {
        panic!("not one blob: {cost}");
    };
    assert_eq!(blob["blob"], "stereo-v2.rays");
    for style in [&[][..], &["--markdown"]] {
        let output = run(&[&arguments, style].concat());
        let text = String::from_utf8(output.stdout).unwrap();
        for work in ["triangulate", "open"] {
            let line = text
                .lines()
                .map(|line| line.trim_start_matches(['|', ' ']))
                .find(|line| {
                    line.strip_prefix(work)
                        .is_some_and(|rest| rest.starts_with("  "))
                });
            let line = line.unwrap_or_else(|| panic!("no line `{work}` in {text}"));
            let least = rows(blob, work).next().unwrap()["instructions"]["min"].to_string();
            assert!(line.contains(&least), "{line}: no {least}");
        }
    }
}

/// The cores of the target that the soft-float check is built for, too: no other image to build.
#[test]
fn cores_of_another_target_are_counted_beside_their_conditions() {
    let file = root().join("data/golden/central-v3-fast.rays");
    let arguments = ["--target", "thumbv7m-none-eabi", "--blob"];
    let arguments = [&arguments[..], &[file.to_str().unwrap()]].concat();
    let across = counted(&arguments);
    let [core] = across["cores"].as_array().unwrap().as_slice() else {
        panic!("not one core: {across}");
    };
    assert_eq!(core["core"], "Cortex-M3");
    assert_eq!(core["conditions"]["target"], "thumbv7m-none-eabi");
    assert_eq!(core["conditions"]["known_block_counted"], 100);
    let [blob] = core["blobs"].as_array().unwrap().as_slice() else {
        panic!("not one blob: {across}");
    };
    // Emulated numbers cost much more than those of an FPU, which takes 387.
    let triangulate = most(blob, "triangulate");
    assert!((10_000..20_000).contains(&triangulate), "{triangulate}");
    assert!(most(blob, "lookup") < triangulate);
    let text = String::from_utf8(run(&arguments).stdout).unwrap();
    let line = text.lines().find(|line| line.contains("Cortex-M3  "));
    assert!(line.is_some() && text.contains("mps2-an385"), "{text}");
}

/// Both by code of the Cortex-M0, of the same pixels.
#[test]
fn points_in_integers_take_an_eighth_of_those_in_f32_without_a_floating_point_unit_or_less() {
    let golden = |name: &str| root().join("data/golden").join(name).display().to_string();
    let [patches, quantized] = ["central-v3-fast.rays", "non-central-v3-cubic.rays"].map(golden);
    let across = counted(&[
        "--target",
        "thumbv6m-none-eabi",
        "--blob",
        &patches,
        "--blob",
        &quantized,
    ]);
    let blobs = across["cores"][0]["blobs"].as_array().unwrap();
    assert_eq!(blobs.len(), 2);
    for blob in blobs {
        let [fixed, from_f32, f32_alone] = [
            "integer_triangulate_fixed",
            "integer_triangulate",
            "triangulate",
        ]
        .map(|work| most(blob, work));
        assert!(fixed > 1000 && 8 * fixed <= f32_alone, "{blob}");
        assert!(from_f32 > fixed && 8 * from_f32 <= f32_alone, "{blob}");
    }
}

#[test]
fn an_index_or_a_division_that_slips_in_breaks_the_link() {
    for image in ["panic_by_index", "panic_by_division"] {
        let output = Command::new(root().join("scripts/embedded-cargo.sh"))
            .args(["build", "--quiet", "--locked", "--release"])
            .args(["--features", "panics", "--bin", image])
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{image} was linked");
        assert!(
            message.contains("a_panic_is_reachable_in_this_image"),
            "{image} failed for another reason: {message}"
        );
    }
}

#[test]
fn a_panic_in_an_image_is_seen_by_its_symbols() {
    // It has a panic handler that prints.
    let image = qemu::build_image("open_and_measure").unwrap();
    assert!(!cost::panics_in(&image).unwrap().is_empty());
}

#[test]
fn what_cannot_be_counted_ends_with_code_2_and_its_reason() {
    let here = root().join("firmware-sim/Cargo.toml");
    let here = here.to_str().unwrap();
    for (arguments, reason) in [
        (&["--blob", "/no/such.rays"][..], "/no/such.rays"),
        (
            &["--blob", here],
            "firmware-sim/Cargo.toml cannot be opened",
        ),
        (&["--json", "--markdown"], "--markdown"),
        (
            &["--target", "x86_64-unknown-linux-gnu"],
            "thumbv6m-none-eabi",
        ),
    ] {
        let output = run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(reason), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    let output = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
        .args(["cost", "--json"])
        .env("PATH", env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("install qemu-system-arm"), "{message}");
    assert!(output.stdout.is_empty());
}

/// The figures may be those of another compiler; the words around them must be the program's.
#[test]
fn the_document_was_written_by_the_program() {
    let document = std::fs::read_to_string(root().join("ray-runtime/COST.md")).unwrap();
    assert!(document.starts_with(include_str!("../../cost/src/method.md")));
    let head = "| instructions ";
    assert!(document.contains(head), "no table");
}
