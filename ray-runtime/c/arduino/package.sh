#!/usr/bin/env bash
# Puts the Arduino library together, a folder to copy into `libraries` of a sketchbook:
#
#   ray-runtime/c/arduino/package.sh FOLDER                 for Cortex-M0+, M4 with an FPU, M7 with an FPU
#
# Arduino looks for a precompiled library under src/MCU/FPU-FLOATABI, or src/MCU where there is no FPU, by the build.mcu of the
# board's platform.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
repository=$(cd "$here/../../.." && pwd)
[ $# = 1 ] || { echo "usage: package.sh FOLDER" >&2; exit 2; }
mkdir -p "$1/src"
folder=$(cd "$1" && pwd)

cp "$here/library.properties" "$folder/"
cp -r "$here/examples" "$folder/"
cp "$repository/LICENSE-MIT" "$repository/LICENSE-APACHE" "$folder/"
for header in rays.h rays.hpp rays_device.h; do cp "$here/../$header" "$folder/src/"; done

for pair in thumbv6m-none-eabi:cortex-m0plus thumbv7em-none-eabihf:cortex-m4/fpv4-sp-d16-hard \
  thumbv7em-none-eabihf:cortex-m7/fpv5-d16-hard; do
  target=${pair%%:*}
  "$repository/scripts/embedded-cargo.sh" build --release --locked --quiet --target "$target" \
    --manifest-path "$repository/ray-runtime/c/Cargo.toml"
  place=$folder/src/${pair#*:}
  mkdir -p "$place"
  cp "$repository/target/embedded/$target/release/librays.a" "$place/"
done
