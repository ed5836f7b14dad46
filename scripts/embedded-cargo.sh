#!/usr/bin/env bash
# Runs cargo in firmware-sim/cortex-m with whichever bare-metal toolchain is there:
#
#   scripts/embedded-cargo.sh build --release --bin device
#   scripts/embedded-cargo.sh build --release --package ray-runtime --target thumbv6m-none-eabi
#
# What is built lands in target/embedded/TARGET/release.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/embedded-env.sh"

embedded_env thumbv7em-none-eabihf thumbv7em-none-eabi thumbv6m-none-eabi || exit 3
cd "$repository/firmware-sim/cortex-m"
exec "$EMBEDDED_CARGO" "$@"
