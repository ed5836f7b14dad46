#!/usr/bin/env bash
# Installs what the Cortex-M images and the C and C++ interface need and this machine lacks: QEMU, a toolchain for bare-metal Arm, a C
# compiler for it without a C library (the example of ray-runtime/c needs none), a second C++ compiler, CMake and pkg-config. Says what it does, and does nothing when all is there. On Debian through apt-get, as root or with sudo; elsewhere it tries
# `rustup target add` for the toolchain and names the packages for the rest.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/embedded-env.sh"
targets=(thumbv7em-none-eabihf thumbv6m-none-eabi)

has_toolchain() {
  local target missing=0
  for target in "${targets[@]}"; do embedded_has_rustup_target "$target" || missing=1; done
  [ $missing = 0 ] || { embedded_debian_release >/dev/null && embedded_find_linker >/dev/null; }
}

packages=()
command -v qemu-system-arm >/dev/null || packages+=(qemu-system-arm)
command -v arm-none-eabi-gcc >/dev/null || packages+=(gcc-arm-none-eabi)
command -v clang++ >/dev/null || packages+=(clang)
command -v cmake >/dev/null || packages+=(cmake make)
command -v pkg-config >/dev/null || packages+=(pkg-config)
if ! has_toolchain; then
  # The four belong together: compiler and sources must be of one release, so those already there are brought along.
  packages+=(rustc-web cargo-web rust-web-src lld)
fi
if [ ${#packages[@]} = 0 ]; then
  echo "install-embedded: QEMU, a bare-metal toolchain, a C compiler for it, clang++, CMake and pkg-config are there already"
  exit 0
fi

as_root=()
if [ "$(id -u)" != 0 ]; then as_root=(sudo); fi
if command -v apt-get >/dev/null && { [ ${#as_root[@]} = 0 ] || command -v sudo >/dev/null; }; then
  echo "install-embedded: apt-get install ${packages[*]}"
  "${as_root[@]}" apt-get update -qq || echo "install-embedded: apt-get update failed; going on with the lists there are" >&2
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "${packages[@]}" >/dev/null ||
    echo "install-embedded: apt-get could not install ${packages[*]}" >&2
fi
if ! has_toolchain && command -v rustup >/dev/null; then
  echo "install-embedded: rustup target add ${targets[*]}"
  rustup target add "${targets[@]}" || true
fi

missing=0
if ! command -v qemu-system-arm >/dev/null; then
  echo "install-embedded: QEMU for Arm is missing: install the package that holds qemu-system-arm" >&2
  missing=1
fi
if ! command -v arm-none-eabi-gcc >/dev/null; then
  # One test does without it and says so.
  echo "install-embedded: no C compiler for bare-metal Arm: install the package that holds arm-none-eabi-gcc" >&2
fi
if ! command -v clang++ >/dev/null; then
  # So does one.
  echo "install-embedded: no clang++, so rays.hpp is tried with g++ alone: install clang" >&2
fi
if ! command -v cmake >/dev/null || ! command -v pkg-config >/dev/null; then
  echo "install-embedded: no CMake or no pkg-config, so the packages of the C library are not tried: install both" >&2
fi
if ! has_toolchain; then
  embedded_no_toolchain "${targets[@]}"
  missing=1
fi
exit $missing
