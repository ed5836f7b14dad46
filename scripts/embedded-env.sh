# Sourced by the other scripts: finds a toolchain for bare-metal Arm and says what it found.
#
#   embedded_available TARGET...   prints those of the targets for which there is a toolchain, and says which are left out
#   embedded_env TARGET...   sets EMBEDDED_CARGO and exports what a build for these targets needs; returns 1 with the
#                            remedy on standard error if there is no toolchain
# EMBEDDED_RUSTFLAGS in the environment goes to the compiler for these targets, such as "-C target-feature=+dsp".
#
# Two kinds of toolchain serve, in this order:
#   1. rustup, when the targets have been added to the toolchain in use;
#   2. Debian's rustc-web, cargo-web and rust-web-src with a linker. They hold no library for bare-metal targets, so core
#      is built once into a sysroot under target/, anew whenever the compiler changes.

repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
embedded_target_dir=$repository/target/embedded

# What an outer cargo, clippy or rustup leaves in the environment would otherwise reach the inner build; incremental compilation
# would even split the images into units of other code, so that their counts would depend on it.
unset RUSTC RUSTDOC RUSTFLAGS CARGO_ENCODED_RUSTFLAGS RUSTC_WRAPPER RUSTC_WORKSPACE_WRAPPER RUSTC_BOOTSTRAP \
  CARGO CARGO_BUILD_TARGET CARGO_BUILD_RUSTFLAGS CARGO_INCREMENTAL
export CARGO_TARGET_DIR=$embedded_target_dir

embedded_has_rustup_target() {
  local sysroot
  sysroot=$(rustc --print sysroot 2>/dev/null) || return 1
  compgen -G "$sysroot/lib/rustlib/$1/lib/libcore-*.rlib" >/dev/null
}

embedded_find_linker() {
  local sysroot candidate
  sysroot=$(rustc --print sysroot 2>/dev/null) || sysroot=/nonexistent
  for candidate in "$sysroot"/lib/rustlib/*/bin/rust-lld rust-lld ld.lld arm-none-eabi-ld; do
    if command -v "$candidate"; then return 0; fi
  done
  return 1
}

# The release of Debian's compiler, if it is new enough and the sources of exactly that release are installed beside it.
embedded_debian_release() {
  local release oldest sources
  [ -x /usr/bin/rustc ] && [ -x /usr/bin/cargo ] || return 1
  release=$(/usr/bin/rustc -vV | sed -n 's/^release: //p')
  oldest=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' "$repository/Cargo.toml")
  if [ "$(printf '%s\n' "$oldest" "$release" | sort -V | head -1)" != "$oldest" ]; then
    echo "embedded: Debian's rustc $release is older than $oldest" >&2
    return 1
  fi
  sources=$(readlink -f /usr/lib/rustlib/src/rust) || return 1
  [ -f "$sources/library/core/Cargo.toml" ] || return 1
  case "$sources" in
    *rustc-"$release") echo "$release" ;;
    *)
      echo "embedded: $sources does not hold the sources of Debian's rustc $release" >&2
      return 1
      ;;
  esac
}

embedded_available() {
  local target debian=0
  if embedded_debian_release >/dev/null && embedded_find_linker >/dev/null; then debian=1; fi
  for target in "$@"; do
    if [ $debian = 1 ] || embedded_has_rustup_target "$target"; then
      echo "$target"
    else
      echo "embedded: left out, as there is no toolchain for it: $target (rustup target add $target)" >&2
    fi
  done
}

embedded_no_toolchain() {
  cat >&2 <<END
embedded: no toolchain for $*. Install one of
  rustup target add $*
  apt-get install rustc-web cargo-web rust-web-src lld      (Debian 12; scripts/install-embedded.sh does it)
END
}

# What a linker and flags are handed over in: LINKER FLAGS TARGET...
embedded_flags() {
  local linker=$1 flags="$2 ${EMBEDDED_RUSTFLAGS:-}" target name
  shift 2
  for target in "$@"; do
    name=${target^^}
    name=${name//[-.]/_}
    if [ -n "$linker" ]; then export "CARGO_TARGET_${name}_LINKER=$linker"; fi
    if [ -n "${flags// /}" ]; then export "CARGO_TARGET_${name}_RUSTFLAGS=$flags"; fi
  done
}

embedded_env() {
  local target all=1 release linker sysroot
  for target in "$@"; do embedded_has_rustup_target "$target" || all=0; done
  if [ $all = 1 ]; then
    embedded_flags "" "" "$@"
    EMBEDDED_CARGO=cargo
    echo "embedded: rustup, $(rustc --version)" >&2
    return 0
  fi
  if ! release=$(embedded_debian_release) || ! linker=$(embedded_find_linker); then
    embedded_no_toolchain "$@"
    return 1
  fi
  EMBEDDED_CARGO=/usr/bin/cargo
  # rustup's cargo takes whatever rustc stands first on PATH, and Debian's takes RUSTC: name it, so that neither errs.
  export RUSTC=/usr/bin/rustc RUSTDOC=/usr/bin/rustdoc
  unset RUSTUP_TOOLCHAIN
  sysroot=$embedded_target_dir/sysroot-$release
  "$repository/scripts/mk-sysroot.sh" "$sysroot" "$@" || return 1
  embedded_flags "$linker" "--sysroot=$sysroot" "$@"
  echo "embedded: Debian's rustc $release, linker $linker" >&2
}
