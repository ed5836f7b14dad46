#!/usr/bin/env python3
"""OpenCV's calibration of a dataset's corners: the figures that the baseline is checked against.

usage: opencv_figures.py DATASET [--corners FILE] [--json]

Runs calibrateCamera on each camera of DATASET/dataset.toml, then stereoCalibrate on the first two
with their intrinsics held fixed and once more with everything free. All stop criteria are as tight
as doubles allow, so that the figures are those of the minimum; only stereoCalibrate with everything
free ends a little before it even so (RMS a share of up to 2e-9 above), and again when begun anew.
Needs Python 3.11 and opencv-python-headless.
"""

import argparse
import csv
import json
import pathlib
import tomllib

import cv2
import numpy as np

TIGHT = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 10000, 1e-16)
NAMES = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"]


def read_views(path):
    """Corners per camera name and pose: {(row, col): (u, v)}."""
    views = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            view = views.setdefault(row["camera"], {}).setdefault(int(row["pose"]), {})
            view[int(row["row"]), int(row["col"])] = (float(row["u"]), float(row["v"]))
    return views


def points(view, labels, square_mm):
    """Board points (mm) and pixels of some corners of a view, as OpenCV takes them."""
    board = np.array([[col * square_mm, row * square_mm, 0.0] for row, col in labels], np.float32)
    pixels = np.array([view[label] for label in labels], np.float32)
    return board, pixels.reshape(-1, 1, 2)


def intrinsics(matrix, distortion):
    values = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *distortion.ravel()[:5]]
    return dict(zip(NAMES, map(float, values)))


def calibrate_camera(views, size, square_mm):
    board, pixels = zip(*(points(view, sorted(view), square_mm) for _, view in sorted(views.items())))
    rms, matrix, distortion, _, _, deviations, _, _ = cv2.calibrateCameraExtended(
        board, pixels, size, None, None, flags=0, criteria=TIGHT
    )
    figures = {
        "views": len(board),
        "corners": int(sum(map(len, board))),
        "rms_px": float(rms),
        "intrinsics": intrinsics(matrix, distortion),
        "standard_deviations": dict(zip(NAMES, map(float, deviations.ravel()[:9]))),
    }
    return figures, matrix, distortion


def calibrate_stereo(first, second, cameras, size, square_mm, flags):
    board, left, right = [], [], []
    for pose in sorted(set(first) & set(second)):
        labels = sorted(set(first[pose]) & set(second[pose]))
        points_of_board, seen = points(first[pose], labels, square_mm)
        board.append(points_of_board)
        left.append(seen)
        right.append(points(second[pose], labels, square_mm)[1])
    (k1, d1), (k2, d2) = [(matrix.copy(), distortion.copy()) for matrix, distortion in cameras]
    rms, k1, d1, k2, d2, rotation, translation, *_ = cv2.stereoCalibrate(
        board, left, right, k1, d1, k2, d2, size, flags=flags, criteria=TIGHT
    )
    return {
        "views": len(board),
        "corners": 2 * int(sum(map(len, board))),
        "rms_px": float(rms),
        "baseline_mm": float(np.linalg.norm(translation)),
        "translation_mm": [float(x) for x in translation.ravel()],
        "rotation_rad": [float(x) for x in cv2.Rodrigues(rotation)[0].ravel()],
        "intrinsics": [intrinsics(k1, d1), intrinsics(k2, d2)],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--corners", type=pathlib.Path, help="instead of DATASET/corners.csv")
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")
    arguments = parser.parse_args()

    manifest = tomllib.loads((arguments.dataset / "dataset.toml").read_text())
    square_mm = float(manifest["board"]["square_mm"])
    views = read_views(arguments.corners or arguments.dataset / "corners.csv")
    figures = {"opencv": cv2.__version__, "cameras": {}}
    calibrated = []
    for camera in manifest["camera"]:
        size = (camera["width"], camera["height"])
        found, *matrices = calibrate_camera(views[camera["name"]], size, square_mm)
        figures["cameras"][camera["name"]] = found
        calibrated.append(matrices)
    if len(calibrated) > 1:
        names = [camera["name"] for camera in manifest["camera"][:2]]
        kinds = {
            "stereo_fixed_intrinsics": cv2.CALIB_FIX_INTRINSIC,
            "stereo_everything": cv2.CALIB_USE_INTRINSIC_GUESS,
        }
        for kind, flags in kinds.items():
            figures[kind] = calibrate_stereo(
                views[names[0]], views[names[1]], calibrated[:2], size, square_mm, flags
            )
    if arguments.json:
        print(json.dumps(figures, indent=1))
        return
    for name, camera in figures["cameras"].items():
        numbers = ", ".join(f"{key} {value:.6g}" for key, value in camera["intrinsics"].items())
        print(f"{name}: {camera['views']} views, RMS {camera['rms_px']:.6f} px; {numbers}")
    for kind in ("stereo_fixed_intrinsics", "stereo_everything"):
        if kind in figures:
            stereo = figures[kind]
            print(f"{kind}: RMS {stereo['rms_px']:.6f} px, baseline {stereo['baseline_mm']:.6f} mm")


if __name__ == "__main__":
    main()
