//! Hands the linker the memory map of the board that runs images of this target, and the section layout of `cortex-m-rt`.

use std::path::Path;

fn main() {
    let target = std::env::var("TARGET").expect("cargo sets it");
    let board = match target.as_str() {
        "thumbv6m-none-eabi" => "microbit",
        "thumbv8m.main-none-eabi" | "thumbv8m.main-none-eabihf" => "sse",
        _ => "mps2",
    };
    let map = format!("memory/{board}.x");
    let folder = std::env::var("OUT_DIR").expect("cargo sets it");
    std::fs::copy(&map, Path::new(&folder).join("memory.x")).expect("the map can be copied");
    println!("cargo:rustc-link-search={folder}");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-changed={map}");
    println!("cargo:rerun-if-changed=build.rs");
}
