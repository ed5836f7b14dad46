//! `c/rays.hpp`: its example by each C++ compiler that is there, held against Rust bit by bit, and all that can be done
//! wrong with it; with exceptions and without, and for a device.

use super::c_build::{WARNINGS, build_for_host, c_folder, made, root, succeed};
use super::c_interface::check_bits;
use std::path::Path;
use std::process::Command;

/// With and without what a device does without.
const KINDS: [(&str, &[&str]); 3] = [
    ("17", &["-std=c++17"]),
    ("20", &["-std=c++20"]),
    ("17-plain", &["-std=c++17", "-fno-exceptions", "-fno-rtti"]),
];

/// The compilers that are there; without any the test fails.
fn compilers() -> Vec<&'static str> {
    let is_there = |name: &&str| Command::new(name).arg("--version").output().is_ok();
    let found: Vec<_> = ["g++", "clang++"].into_iter().filter(is_there).collect();
    for name in ["g++", "clang++"] {
        if !found.contains(&name) {
            eprintln!(
                "{name} is missing, so rays.hpp was not tried with it: run scripts/install-embedded.sh"
            );
        }
    }
    assert!(
        !found.is_empty(),
        "no C++ compiler: install g++ or clang, or run scripts/install-embedded.sh"
    );
    found
}

fn build(compiler: &str, flags: &[&str], source: &Path, library: &Path, program: &Path) {
    let mut command = Command::new(compiler);
    command.args(flags).args(WARNINGS).args(["-O2", "-I."]);
    command.arg(source).arg(library).arg("-o").arg(program);
    succeed(command.current_dir(c_folder()));
}

#[test]
fn the_cpp_example_gives_the_bits_of_rust() {
    let library = build_for_host("librays-cpp.a", &[]);
    for compiler in compilers() {
        for (kind, flags) in KINDS {
            let program = made(&format!("example-{compiler}-{kind}"));
            build(
                compiler,
                flags,
                Path::new("example.cpp"),
                &library,
                &program,
            );
            check_bits(|blob| succeed(Command::new(&program).arg(blob)));
        }
    }
}

#[test]
fn what_cpp_cannot_open_or_ask_has_its_code() {
    let library = build_for_host("librays-cpp-misuse.a", &[]);
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/cpp_misuse.cpp");
    for compiler in compilers() {
        for (kind, flags) in KINDS {
            let program = made(&format!("misuse-{compiler}-{kind}"));
            build(compiler, flags, &source, &library, &program);
            let blob = root().join("data/golden/stereo-v2.rays");
            let printed = succeed(Command::new(&program).arg(blob));
            assert_eq!(printed, "all as it should be\n", "{compiler} {kind}");
        }
    }
}

#[test]
fn the_cpp_header_needs_no_library_on_a_device() {
    let bare = [
        "-std=c++17",
        "-ffreestanding",
        "-fno-exceptions",
        "-fno-rtti",
        "-fsyntax-only",
    ];
    let check = |compiler: &str, flags: &[&str]| {
        let mut command = Command::new(compiler);
        command.args(bare).args(flags).args(WARNINGS);
        succeed(
            command
                .args(["-x", "c++", "rays.hpp"])
                .current_dir(c_folder()),
        );
    };
    for compiler in compilers() {
        // Where no header of the standard library is found but those of the compiler itself.
        check(compiler, &["-nostdinc++"]);
    }
    let arm = "arm-none-eabi-g++";
    if Command::new(arm).arg("--version").output().is_ok() {
        check(arm, &["-mthumb", "-mcpu=cortex-m4", "-nostdinc++"]);
    } else {
        eprintln!(
            "{arm} is missing, so rays.hpp was not tried with it: run scripts/install-embedded.sh"
        );
    }
}
