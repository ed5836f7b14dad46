#!/usr/bin/env python3
"""OpenCV and PyYAML read what calib-offline export wrote, and OpenCV's triangulation with it is held against ours.

usage: read_exports.py PROGRAM DATASET

Calibrates DATASET, exports it as opencv, ros and kalibr, and triangulates the corners that both cameras saw: with OpenCV and the
exported pinholes, and with measure. After the best rigid motion (the frames differ) the points differ by what the pinholes lose:
px RMS times what a pixel is in depth. Readers of ROS and Kalibr are stood for by PyYAML, which theirs are built on.
"""

import csv
import json
import pathlib
import subprocess
import sys
import tempfile

import cv2
import numpy as np
import yaml


def read_matrix(storage, key):
    matrix = storage.getNode(key).mat()
    assert matrix is not None and matrix.dtype == np.float64, key
    return matrix


def read_camera(path):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened(), path
    size = [int(storage.getNode(key).real()) for key in ("image_width", "image_height")]
    return size, read_matrix(storage, "camera_matrix"), read_matrix(storage, "distortion_coefficients")


def matches(corners):
    seen = {}
    with open(corners, newline="") as file:
        for row in csv.DictReader(file):
            key = (row["pose"], row["row"], row["col"])
            seen.setdefault(key, {})[row["camera"]] = (float(row["u"]), float(row["v"]))
    return {"-".join(key): pixels for key, pixels in seen.items() if len(pixels) == 2}


def after_rigid_motion(points, others):
    points, others = points - points.mean(0), others - others.mean(0)
    left, _, right = np.linalg.svd(points.T @ others)
    turn = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    return points @ turn - others


def main():
    program, dataset = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)

        def run(*arguments):
            subprocess.run([program, *map(str, arguments), "-q"], cwd=folder, check=True, stdout=subprocess.DEVNULL)

        run("calibrate", dataset, "-o", "results")
        for form in ("opencv", "ros", "kalibr"):
            run("export", "results/calibration.json", "--format", form, "-o", form)
        names = [camera["name"] for camera in json.loads((folder / "opencv.loss.json").read_text())["cameras"]]
        chain = yaml.safe_load((folder / "kalibr/camchain.yaml").read_text())
        cameras = {}
        for number, name in enumerate(names):
            size, matrix, distortion = cameras[name] = read_camera(folder / f"opencv/{name}.yml")
            ros = yaml.safe_load((folder / f"ros/{name}.yaml").read_text())
            assert [ros["image_width"], ros["image_height"]] == size
            assert ros["camera_matrix"]["data"] == matrix.ravel().tolist()
            assert ros["distortion_coefficients"]["data"] == distortion.ravel().tolist()
            if int(cv2.__version__.split(".")[0]) >= 5:  # earlier ones want a head line, which ROS' readers refuse
                assert np.array_equal(read_camera(folder / f"ros/{name}.yaml")[1], matrix)
            kalibr = chain[f"cam{number}"]
            assert kalibr["resolution"] == size
            numbers = kalibr["intrinsics"] + kalibr["distortion_coeffs"]
            assert len(numbers) == 8 and all(isinstance(value, float) for value in numbers)
        storage = cv2.FileStorage(str(folder / "opencv/extrinsics.yml"), cv2.FILE_STORAGE_READ)
        rotation, translation = read_matrix(storage, "R"), read_matrix(storage, "T")
        assert np.allclose(np.array(chain["cam1"]["T_cn_cnm1"])[:3, 3] * 1000, translation.ravel(), atol=0.2)

        pairs = matches(dataset / "corners_opencv.csv")
        rows = [f"{key},{','.join(str(x) for name in names for x in pixels[name])}" for key, pixels in pairs.items()]
        header = "id," + ",".join(f"u_{name},v_{name}" for name in names)
        (folder / "matches.csv").write_text("\n".join([header, *rows, ""]))
        run("measure", "results/calibration.json", "matches.csv", "-o", "points.csv")
        with open(folder / "points.csv", newline="") as file:
            ours = {row["id"]: [float(row[axis]) for axis in "xyz"] for row in csv.DictReader(file) if row["status"] == "ok"}
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-14)
        ideal = [
            cv2.undistortPoints(np.array([[pairs[key][name]] for key in ours]), *cameras[name][1:], None, None, None, stop)
            for name in names
        ]
        projections = np.eye(3, 4), np.hstack([rotation, translation])
        found = cv2.triangulatePoints(*projections, ideal[0].reshape(-1, 2).T, ideal[1].reshape(-1, 2).T)
        found = (found[:3] / found[3]).T

        difference = after_rigid_motion(found, np.array(list(ours.values())))
        rms_mm = float(np.sqrt((difference**2).sum(1).mean()))
        loss = json.loads((folder / "opencv.loss.json").read_text())
        depth = found[:, 2].mean()
        in_depth = depth / np.linalg.norm(translation)
        # Both cameras' losses along the baseline, each a coordinate's share, seen in depth; twice that for distances
        # other than the fit's.
        most_mm = 2 * loss["rms_mm"] * in_depth
        print(f"OpenCV {cv2.__version__}: {len(ours)} points at {depth:.0f} mm, {rms_mm:.4f} mm RMS from ours; "
              f"lost by the pinholes {loss['rms_px']:.4f} px, at most {most_mm:.4f} mm in depth")
        assert rms_mm < most_mm


if __name__ == "__main__":
    main()
