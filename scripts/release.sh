#!/usr/bin/env bash
# What a release holds, in target/release-files: the program as a static binary for Linux on x86-64 and aarch64, and the Python wheel.
#
#   scripts/release.sh                 all of it; ends with code 3 if a part could not be built here, and says which and why
#   scripts/release.sh plan            which parts can be built on this machine, and with what; builds nothing
#   scripts/release.sh PART...         only these: x86_64, aarch64, wheel
#
# For each machine the first of these that is there:
#   1. rustup with the target MACHINE-unknown-linux-musl (rustup target add ...): static with musl
#   2. for this very machine the compiler in use, against glibc's own static library (libc6-dev)
#   3. for aarch64 Debian's rustc-web and cargo-web, gcc-aarch64-linux-gnu and libc6-dev-arm64-cross, with the standard library for
#      arm64 out of Debian's package of the same release, unpacked under target/: static with glibc
# A static glibc resolves no host names without the shared one; `--device tcp:HOST` therefore takes addresses there. What was built is run: here,
# or with qemu-aarch64-static where it is installed.
#
# Whoever has a compiler needs none of this: cargo install --locked --path calib-offline.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

files=$PWD/target/release-files
export CARGO_TARGET_DIR=$PWD/target/release-build
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_TARGET CARGO_INCREMENTAL
this_machine=$(uname -m)

has_target() {
  compgen -G "$(rustc --print sysroot)/lib/rustlib/$1/lib/libstd-*.rlib" >/dev/null
}

debian_release() {
  [ -x /usr/bin/rustc ] && [ -x /usr/bin/cargo ] || return 1
  local release oldest
  release=$(/usr/bin/rustc -vV | sed -n 's/^release: //p')
  oldest=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
  [ "$(printf '%s\n' "$oldest" "$release" | sort -V | head -1)" = "$oldest" ] || return 1
  echo "$release"
}

# How a machine's binary can be built here: musl, glibc or debian.
way() {
  local machine=$1
  if has_target "$machine-unknown-linux-musl"; then
    echo musl
  elif [ "$machine" = "$this_machine" ] && has_target "$machine-unknown-linux-gnu" && [ -e "$(cc -print-file-name=libc.a)" ]; then
    echo glibc
  elif [ "$machine" = aarch64 ] && debian_release >/dev/null && command -v aarch64-linux-gnu-gcc >/dev/null &&
    [ -e "$(aarch64-linux-gnu-gcc -print-file-name=libc.a)" ]; then
    echo debian
  else
    return 1
  fi
}

remedy() {
  echo "  rustup target add $1-unknown-linux-musl" >&2
  if [ "$1" = aarch64 ]; then
    echo "  apt-get install rustc-web cargo-web gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static      (Debian 12)" >&2
  fi
}

# The standard library for arm64 that belongs to Debian's compiler, as a sysroot; where it is.
debian_sysroot() {
  local release=$1 sysroot=$PWD/target/release-sysroot-$1 lists=$PWD/target/release-lists version options
  if ! compgen -G "$sysroot/lib/rustlib/aarch64-unknown-linux-gnu/lib/libstd-*.rlib" >/dev/null; then
    version=$(dpkg-query -W -f '${Version}' rustc-web)
    mkdir -p "$sysroot" "$lists/partial"
    # Lists of their own: the machine itself is told nothing of another architecture.
    options=(-qq -o APT::Architectures::="$(dpkg --print-architecture)" -o APT::Architectures::=arm64 -o "Dir::State::lists=$lists")
    (
      cd "$lists"
      apt-get "${options[@]}" update
      apt-get "${options[@]}" download "libstd-rust-web-dev:arm64=$version"
      dpkg-deb -x libstd-rust-web-dev_*_arm64.deb unpacked
    ) >&2
    mkdir -p "$sysroot/lib/rustlib"
    cp -a "$lists"/unpacked/usr/lib/rustlib/aarch64-unknown-linux-gnu "$sysroot/lib/rustlib/"
    rm -rf "$lists"
  fi
  echo "$sysroot"
}

binary() {
  local machine=$1 how target sysroot cargo=(cargo) run=()
  if ! how=$(way "$machine"); then
    echo "release: left out: the binary for $machine, as nothing here links it. Install one of" >&2
    remedy "$machine"
    return 3
  fi
  target=$machine-unknown-linux-gnu
  [ "$how" = musl ] && target=$machine-unknown-linux-musl
  local variable=CARGO_TARGET_${target^^}
  variable=${variable//-/_}
  local flags="-C target-feature=+crt-static"
  if [ "$how" = debian ]; then
    sysroot=$(debian_sysroot "$(debian_release)")
    flags+=" --sysroot=$sysroot"
    cargo=(env -u RUSTUP_TOOLCHAIN RUSTC=/usr/bin/rustc RUSTDOC=/usr/bin/rustdoc /usr/bin/cargo)
    export "${variable}_LINKER=aarch64-linux-gnu-gcc"
  fi
  export "${variable}_RUSTFLAGS=$flags"
  echo "release: the program for $machine, static ($how)" >&2
  "${cargo[@]}" build --locked --release -p calib-offline --bin calib-offline --target "$target"
  local built=$CARGO_TARGET_DIR/$target/release/calib-offline named=$files/calib-offline-$machine-linux
  mkdir -p "$files"
  cp "$built" "$named"
  # What is not static names an interpreter.
  if LC_ALL=C readelf -l "$named" | grep -q INTERP; then
    echo "release: $named is not static" >&2
    return 1
  fi
  if [ "$machine" != "$this_machine" ]; then
    if ! command -v "qemu-$machine-static" >/dev/null; then
      echo "release: $named was not run: qemu-$machine-static is missing" >&2
      return 0
    fi
    run=("qemu-$machine-static")
  fi
  local blob=data/golden/stereo-v3-fast.rays matches=$CARGO_TARGET_DIR/matches.csv points=$CARGO_TARGET_DIR/points-$machine.csv
  printf 'id,u_left,v_left,u_right,v_right\n1,30,20.5,33,21\n2,10.25,11,14,11.5\n' >"$matches"
  "${run[@]}" "$named" --version
  "${run[@]}" "$named" measure "$blob" "$matches" -o "$points" --force
  cat "$points"
}

wheel() {
  echo "release: the Python wheel" >&2
  local environment
  environment=$(scripts/python-env.sh)
  mkdir -p "$files"
  cp "$environment"/wheels/rays-*.whl "$files/"
}

plan() {
  local machine how
  for machine in x86_64 aarch64; do
    if how=$(way "$machine"); then
      echo "$machine: static, $how"
    else
      echo "$machine: not here; install one of" >&2
      remedy "$machine"
    fi
  done
  if python3 -c 'import venv' 2>/dev/null; then echo "wheel: maturin in an environment of its own"; else echo "wheel: not here: python3 with venv" >&2; fi
}

if [ $# = 0 ]; then set -- x86_64 aarch64 wheel; fi
missing=0
for part in "$@"; do
  case $part in
    plan) plan ;;
    x86_64 | aarch64)
      # Not behind || or in an if, where a failure inside would end nothing.
      set +e
      (
        set -e
        binary "$part"
      )
      code=$?
      set -e
      case $code in 0) ;; 3) missing=3 ;; *) exit $code ;; esac
      ;;
    wheel) (unset CARGO_TARGET_DIR; wheel) ;;
    *)
      echo "scripts/release.sh: plan, x86_64, aarch64 or wheel, not \"$part\"" >&2
      exit 2
      ;;
  esac
done
if [ -d "$files" ] && [ "$*" != plan ]; then (cd "$files" && sha256sum ./*); fi
exit $missing
