#!/usr/bin/env bash
# Builds core once for bare-metal targets from Debian's compiler and library sources, and lays it out as a sysroot.
# With it, builds for these targets are plain `cargo build --target`: nothing unstable is switched on in them.
# The sysroot holds core and nothing else, so a crate that needs alloc does not build with it.
#
#   scripts/mk-sysroot.sh SYSROOT TARGET...      does nothing for the targets that are there already
set -euo pipefail

sysroot=$1
shift
mkdir -p "$sysroot"
# One builder at a time; whoever waited finds the work done.
exec 9>"$sysroot/lock"
flock 9

version=$(/usr/bin/rustc --version)
targets=()
for target in "$@"; do
  if [ "$(cat "$sysroot/$target.version" 2>/dev/null)" != "$version" ]; then targets+=("$target"); fi
done
if [ ${#targets[@]} = 0 ]; then exit 0; fi
echo "embedded: building core for ${targets[*]} with $version, once" >&2

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/src"
echo '#![no_std]' >"$work/src/lib.rs"
cat >"$work/Cargo.toml" <<'END'
[package]
name = "empty"
version = "0.0.0"
edition = "2024"
[profile.release]
panic = "abort"
[workspace]
END
arguments=()
for target in "${targets[@]}"; do arguments+=(--target "$target"); done
(
  cd "$work"
  # -Z is for nightly compilers unless this is set; it reaches this one build alone. Bitcode lets images link with LTO.
  RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 RUSTFLAGS=-Cembed-bitcode=yes CARGO_TARGET_DIR=$work/target \
    /usr/bin/cargo build --quiet --release -Z build-std=core "${arguments[@]}" 9>&-
)
for target in "${targets[@]}"; do
  library=$sysroot/lib/rustlib/$target/lib
  rm -rf "$library"
  mkdir -p "$library"
  cp "$work/target/$target/release/deps/"lib{core,compiler_builtins}-*.rlib "$library/"
  echo "$version" >"$sysroot/$target.version"
done
