#!/usr/bin/env bash
# Builds ray-runtime and ray-device as somebody else's project has them. Without arguments both of these, else those named:
#
#   copied      the folders of the two crates, and nothing else of this repository, beside an application that names them by path: for
#               this machine and six bare-metal targets; and the documentation's examples
#   packaged    what `cargo package` would publish, unpacked into an application's `vendor` folder, in place of a registry: for this
#               machine and the smallest target
#
# Each is built with none of the features and with all; that of nalgebra on this machine alone, as it takes half a minute a target.
# Targets without a toolchain are left out, and named. Ends with a non-zero code at the first failure.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
repository=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# An application in $1 that names the crates as $2 and $3 and has the lines of $4 in its manifest. It has this repository's versions of
# all other packages, so that nothing is fetched that is not here.
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
all = ["ray-runtime/patches", "ray-runtime/quantized", "ray-runtime/old-versions", "ray-runtime/defmt", "ray-device/old-versions",
  "ray-device/signed", "ray-device/defmt", "ray-device/embedded-io", "ray-device/embedded-io-async"]
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

# The application in $1 for this machine and for those of the other targets that there is a toolchain for.
build() {
  local application=$1 features target targets arguments=()
  shift
  targets=$(source scripts/embedded-env.sh && embedded_available "$@")
  for target in $targets; do arguments+=(--target "$target"); done
  for features in "" all; do
    (cd "$application" && CARGO_TARGET_DIR=$repository/target/outside cargo build --quiet --offline --features "$features nalgebra")
    if [ ${#arguments[@]} != 0 ]; then
      scripts/embedded-cargo.sh build --quiet --offline --features "$features" --manifest-path "$application/Cargo.toml" "${arguments[@]}"
    fi
    echo "builds-outside: ${application##*/}, features \"$features\": this machine" $targets
  done
}

# The files of a folder that git knows: neither what was built nor what lies about.
copy() {
  local file
  git ls-files -z "$1" | while IFS= read -r -d '' file; do
    mkdir -p "$2/$(dirname "$file")"
    cp "$file" "$2/$file"
  done
}

copied() {
  copy ray-runtime "$work"
  copy firmware-sim/ray-device "$work"
  application "$work/copied" 'path = "../ray-runtime"' 'path = "../firmware-sim/ray-device"' ""
  build "$work/copied" thumbv6m-none-eabi thumbv7em-none-eabi thumbv7em-none-eabihf thumbv8m.main-none-eabihf \
    riscv32imac-unknown-none-elf aarch64-unknown-none
  # The README's example among them, which reads the blob that comes with the crate.
  cp Cargo.lock "$work/ray-runtime/"
  (cd "$work/ray-runtime" && CARGO_TARGET_DIR=$repository/target/outside cargo test --quiet --offline --doc)
}

packaged() {
  local name file needed
  CARGO_TARGET_DIR=$repository/target/outside cargo package --quiet --offline --no-verify --allow-dirty -p ray-runtime -p ray-device
  mkdir -p "$work/packaged/vendor"
  for name in ray-runtime ray-device; do
    file=$(ls target/outside/package/$name-[0-9]*.crate)
    tar -xzf "$file" -C "$work/packaged/vendor"
    mv "$work/packaged/vendor/$(basename "$file" .crate)" "$work/packaged/vendor/$name"
    for needed in LICENSE-MIT LICENSE-APACHE README.md; do
      [ -f "$work/packaged/vendor/$name/$needed" ] || { echo "builds-outside: no $needed in the package of $name" >&2; exit 1; }
    done
  done
  application "$work/packaged" 'version = "0.1"' 'version = "0.1"' '[patch.crates-io]
ray-runtime = { path = "vendor/ray-runtime" }
ray-device = { path = "vendor/ray-device" }'
  build "$work/packaged" thumbv6m-none-eabi
}

if [ $# = 0 ]; then set -- copied packaged; fi
for way in "$@"; do
  case $way in
    copied | packaged) "$way" ;;
    *)
      echo "builds-outside: copied or packaged, not \"$way\"" >&2
      exit 2
      ;;
  esac
done
