#!/usr/bin/env bash
# Other tools on the same data, in one run: OpenCV's calibration of stored corners against the stored figures, OpenCV's
# triangulation with exported pinholes, and it and mrcal's splined solve against ours in CPU seconds, OpenCV's detectors of printed targets on rendered images. Installs OpenCV into a virtual environment under
# target/peers and mrcal by apt-get where they are missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

environment=$PWD/target/peers
if ! "$environment/bin/python" -c 'import cv2, yaml' 2>/dev/null; then
  python3 -m venv "$environment"
  # The version that data/opencv-figures was made with.
  "$environment/bin/pip" install --quiet opencv-python-headless==5.0.0.93 pyyaml
fi
export PATH="$environment/bin:$PATH"
if ! command -v mrcal-calibrate-cameras >/dev/null; then
  as_root=()
  if [ "$(id -u)" != 0 ]; then as_root=(sudo); fi
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends mrcal >/dev/null
fi

printf '\n==> OpenCV on data/opencv-stereo: the figures that the pinhole is tested against\n'
python scripts/opencv_figures.py data/opencv-stereo --corners data/opencv-stereo/corners_opencv.csv --json |
  python scripts/same_figures.py data/opencv-figures/opencv-stereo.json

printf '\n==> OpenCV and PyYAML on exported pinholes\n'
cargo build --locked --release -p calib-offline
python scripts/read_exports.py target/release/calib-offline data/opencv-stereo

printf '\n==> OpenCV: points per second\n'
cargo bench --locked -p calib-offline --bench throughput

printf '\n==> mrcal: the same corners, splined\n'
cargo bench --locked -p calib-offline --bench estimate -- brown port

printf '\n==> OpenCV: printed targets on the same images\n'
cargo bench --locked -p calib-offline --bench targets -- --images 200 --opencv "$environment/bin/python"
