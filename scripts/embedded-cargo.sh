#!/usr/bin/env bash
# Runs cargo in firmware-sim/cortex-m with whichever bare-metal toolchain is there:
#
#   scripts/embedded-cargo.sh build --release --bin device
#   scripts/embedded-cargo.sh build --release --target thumbv6m-none-eabi --manifest-path "$PWD/ray-runtime/c/Cargo.toml"
#
# Without --target it builds for thumbv7em-none-eabihf. What is built lands in target/embedded/TARGET/release. Ends with
# code 3 if there is no toolchain for the target.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/embedded-env.sh"

targets=()
last=
for argument in "$@"; do
  if [ "$last" = --target ]; then targets+=("$argument"); fi
  case $argument in --target=*) targets+=("${argument#--target=}") ;; esac
  last=$argument
done
if [ ${#targets[@]} = 0 ]; then targets=(thumbv7em-none-eabihf); fi

embedded_env "${targets[@]}" || exit 3
cd "$repository/firmware-sim/cortex-m"
exec "$EMBEDDED_CARGO" "$@"
