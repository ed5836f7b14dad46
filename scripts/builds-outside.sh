#!/usr/bin/env bash
# Builds ray-runtime and ray-device as somebody else's project has them, for this machine and for bare metal:
#
#   copied      the folders of the two crates, and nothing else of this repository, beside an application that names them by path
#   packaged    what `cargo package` would publish, unpacked into an application's `vendor` folder, in place of a registry
#
# with none of the features and with all but that of nalgebra, which is tried on this machine alone: it takes half a minute a target. Targets without a toolchain are left out, and named. Ends with a non-zero code at the first failure.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
repository=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

targets=$(
  source scripts/embedded-env.sh
  embedded_available thumbv6m-none-eabi thumbv7em-none-eabi thumbv7em-none-eabihf thumbv8m.main-none-eabihf \
    riscv32imac-unknown-none-elf aarch64-unknown-none
)

# An application in $1 that names the crates as $2 and $3 and has the lines of $4 in its manifest. It has this repository's versions of all other
# packages, so that nothing is fetched that is not here.
application() {
  mkdir -p "$1/src"
  cp Cargo.lock "$1/"
  cat >"$1/Cargo.toml" <<END
[package]
name = "application"
version = "0.1.0"
edition = "2024"
[dependencies]
ray-runtime = { $2, default-features = false }
ray-device = { $3, default-features = false }
[features]
all = ["ray-runtime/patches", "ray-runtime/quantized", "ray-runtime/old-versions", "ray-runtime/defmt", "ray-device/old-versions", "ray-device/signed",
  "ray-device/defmt", "ray-device/embedded-io", "ray-device/embedded-io-async"]
nalgebra = ["ray-runtime/nalgebra"]
[workspace]
$4
END
  cat >"$1/src/lib.rs" <<'END'
//! Uses both crates, so that neither is left out.
#![no_std]

/// The depth of a match, and its gap noted.
pub fn depth_mm(blob: &[u8], health: &mut ray_device::health::Health) -> Option<f32> {
    let rig = ray_runtime::RayBlob::open(blob).ok()?;
    let pixel = ray_runtime::PixelPoint::new(30.0, 20.5);
    let measured = rig.triangulate_with_covariance((0, pixel), (1, pixel)).ok()?;
    health.note(&measured);
    Some(measured.found.point_mm[2])
}
END
}

build() {
  local features target
  for features in "" all; do
    (
      export CARGO_TARGET_DIR=$repository/target/outside
      cd "$1"
      cargo build --quiet --offline --features "$features nalgebra"
    )
    arguments=()
    for target in $targets; do arguments+=(--target "$target"); done
    if [ ${#arguments[@]} != 0 ]; then
      scripts/embedded-cargo.sh build --quiet --offline --features "$features" --manifest-path "$1/Cargo.toml" "${arguments[@]}"
    fi
    echo "$2, features \"$features\": this machine" $targets
  done
}

# The lists of files that git knows: neither what was built nor what lies about.
copy() {
  mkdir -p "$2"
  git ls-files -z "$1" | while IFS= read -r -d '' file; do
    mkdir -p "$2/$(dirname "${file#"$1"/}")"
    cp "$file" "$2/${file#"$1"/}"
  done
}
copy ray-runtime "$work/copied/ray-runtime"
copy firmware-sim/ray-device "$work/copied/firmware-sim/ray-device"
application "$work/copied/application" 'path = "../ray-runtime"' 'path = "../firmware-sim/ray-device"' ""
build "$work/copied/application" copied
# The README's example and the documentation's, which read the blob that comes with the crate.
(cd "$work/copied/ray-runtime" && cp "$repository/Cargo.lock" . &&
  CARGO_TARGET_DIR=$repository/target/outside cargo test --quiet --offline --doc)

CARGO_TARGET_DIR=$repository/target/outside cargo package --quiet --offline --no-verify --allow-dirty -p ray-runtime -p ray-device
mkdir -p "$work/packaged/vendor"
for name in ray-runtime ray-device; do
  file=$(ls target/outside/package/$name-[0-9]*.crate)
  tar -xzf "$file" -C "$work/packaged/vendor"
  mv "$work/packaged/vendor/$(basename "$file" .crate)" "$work/packaged/vendor/$name"
  for licence in LICENSE-MIT LICENSE-APACHE README.md; do
    [ -f "$work/packaged/vendor/$name/$licence" ] || { echo "$name: no $licence in the package" >&2; exit 1; }
  done
done
application "$work/packaged" 'version = "0.1"' 'version = "0.1"' '[patch.crates-io]
ray-runtime = { path = "vendor/ray-runtime" }
ray-device = { path = "vendor/ray-device" }'
build "$work/packaged" packaged
