#!/usr/bin/env bash
# A virtual environment with the Python modules of ray-runtime/python as a wheel, and what their tests need; the last line on
# standard output is where it is. What is there already stays, but the wheel is built again.
#
#   scripts/python-env.sh                    for tests
#   scripts/python-env.sh --speed            for benches/speed.py: with OpenCV, and with the Rust call that it times
#   scripts/python-env.sh --example          for examples/: with OpenCV and matplotlib
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

name=tests
packages=(maturin==1.16.0 numpy==2.4.6 pytest==9.2.0)
build=()
case ${1:-} in
  "") ;;
  --speed)
    name=speed
    # OpenCV's version is that of scripts/peers.sh.
    packages+=(opencv-python-headless==5.0.0.93)
    build=(--features timing)
    ;;
  --example)
    name=example
    packages+=(opencv-python-headless==5.0.0.93 matplotlib==3.11.2)
    ;;
  *)
    echo "scripts/python-env.sh: --speed, --example or nothing, not \"$1\"" >&2
    exit 2
    ;;
esac
environment=$PWD/target/python/$name
if [ "$(cat "$environment/packages" 2>/dev/null)" != "${packages[*]}" ]; then
  rm -rf "$environment"
  python3 -m venv "$environment"
  "$environment/bin/python" -m pip install --quiet --disable-pip-version-check "${packages[@]}" >&2
  echo "${packages[*]}" >"$environment/packages"
fi
rm -rf "$environment/wheels"
# An outer cargo's settings are not for this build.
env -u CARGO_BUILD_TARGET -u RUSTFLAGS CARGO_TARGET_DIR="$PWD/target/python-build" \
  "$environment/bin/maturin" build --quiet --release --locked "${build[@]}" \
  --interpreter "$environment/bin/python" --manifest-path ray-runtime/python/Cargo.toml --out "$environment/wheels" >&2
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall \
  "$environment"/wheels/rays-*.whl >&2
echo "$environment"
