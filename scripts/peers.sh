#!/usr/bin/env bash
# Other tools on the same data, in one run: OpenCV's calibration of stored corners against the stored figures, OpenCV's
# triangulation with exported pinholes, and it and mrcal's splined solve against ours in CPU seconds, OpenCV's detectors of printed targets on rendered images. Installs OpenCV into a virtual environment under
# target/peers and mrcal by apt-get where they are missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

environment=$PWD/target/peers
if ! "$environment/bin/python" -c 'import cv2, plyfile, pycolmap, yaml' 2>/dev/null; then
  python3 -m venv "$environment"
  # The version that data/opencv-figures was made with.
  "$environment/bin/pip" install --quiet opencv-python-headless==5.0.0.93 pycolmap==4.2.1 plyfile==1.1.5 pyyaml
fi
if ! "$environment-4/bin/python" -c 'import cv2' 2>/dev/null; then
  python3 -m venv "$environment-4"
  "$environment-4/bin/pip" install --quiet opencv-python-headless==4.14.0.94
fi
export PATH="$environment/bin:$PATH"
if ! /usr/bin/python3 -c 'import mrcal' 2>/dev/null || ! command -v mrcal-calibrate-cameras >/dev/null; then
  as_root=()
  if [ "$(id -u)" != 0 ]; then as_root=(sudo); fi
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends mrcal python3-mrcal >/dev/null
fi

printf '\n==> OpenCV on data/opencv-stereo: the figures that the pinhole is tested against\n'
python scripts/opencv_figures.py data/opencv-stereo --corners data/opencv-stereo/corners_opencv.csv --json |
  python scripts/same_figures.py data/opencv-figures/opencv-stereo.json

printf '\n==> OpenCV and PyYAML on exported pinholes\n'
cargo build --locked --release -p calib-offline
python scripts/read_exports.py target/release/calib-offline data/opencv-stereo

printf '\n==> OpenCV, mrcal and plyfile on exported lenses, maps, images and points\n'
made=$(mktemp -d)
python scripts/read_models.py make target/release/calib-offline data/opencv-stereo "$made"
python scripts/read_models.py opencv "$made"
"$environment-4/bin/python" -c 'import plyfile' 2>/dev/null || "$environment-4/bin/pip" install --quiet plyfile==1.1.5
"$environment-4/bin/python" scripts/read_models.py opencv "$made"
/usr/bin/python3 scripts/read_models.py mrcal "$made"
rm -r "$made"

printf '\n==> OpenCV, mrcal and COLMAP: the projections that their models are tested against\n'
made=$(mktemp -d)
python scripts/golden_projections.py opencv "$made"
python scripts/golden_projections.py colmap "$made"
/usr/bin/python3 scripts/golden_projections.py mrcal "$made"
"$environment-4/bin/python" scripts/golden_projections.py opencv "$made"
python scripts/same_projections.py calib-offline/exchange/golden "$made"
rm -r "$made"

printf '\n==> OpenCV: its own calibration under audit\n'
python scripts/audit_opencv.py target/release/calib-offline data/opencv-stereo data/opencv-stereo/corners_opencv.csv

printf '\n==> OpenCV: points per second\n'
cargo bench --locked -p calib-offline --bench throughput

printf '\n==> mrcal: the same corners, splined\n'
cargo bench --locked -p calib-offline --bench estimate -- brown port

printf '\n==> OpenCV: printed targets on the same images\n'
cargo bench --locked -p calib-offline --bench targets -- --images 200 --opencv "$environment/bin/python"
