#!/usr/bin/env python3
"""OpenCV's own calibration of a dataset's corners, handed to calib-offline audit: it must find OpenCV's RMS.

usage: audit_opencv.py PROGRAM DATASET CORNERS [--write FOLDER]

Calibrates all pairs with calibrateCamera and stereoCalibrate (intrinsics fixed), writes FileStorage files, and audits them on the
same corners: RMS to four digits. Then every other pair, audited on the pairs that OpenCV never saw. --write keeps the files of the
first in FOLDER (calib-offline/exchange/golden/opencv-stereo).
"""

import argparse
import json
import pathlib
import subprocess
import tempfile
import tomllib

import cv2

from opencv_figures import TIGHT, calibrate_camera, points, read_views


def write(path, **values):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, value)
    storage.release()


def calibrate(manifest, views, folder):
    """The files, and OpenCV's RMS per camera and of the pair."""
    square_mm = float(manifest["board"]["square_mm"])
    rms, found = {}, []
    for camera in manifest["camera"]:
        size = (camera["width"], camera["height"])
        figures, matrix, distortion = calibrate_camera(views[camera["name"]], size, square_mm)
        rms[camera["name"]] = figures["rms_px"]
        found.append((matrix, distortion))
        write(
            folder / f"{camera['name']}.yml",
            image_width=size[0],
            image_height=size[1],
            camera_matrix=matrix,
            distortion_coefficients=distortion,
        )
    first, second = (views[camera["name"]] for camera in manifest["camera"])
    board, left, right = [], [], []
    for pose in sorted(set(first) & set(second)):
        labels = sorted(set(first[pose]) & set(second[pose]))
        points_of_board, seen = points(first[pose], labels, square_mm)
        board.append(points_of_board)
        left.append(seen)
        right.append(points(second[pose], labels, square_mm)[1])
    pair, _, _, _, _, rotation, translation, *_ = cv2.stereoCalibrate(
        board, left, right, *found[0], *found[1], size, flags=cv2.CALIB_FIX_INTRINSIC, criteria=TIGHT
    )
    write(folder / "extrinsics.yml", R=rotation, T=translation)
    return rms, pair


def audit(program, dataset, views, files, folder):
    """The audit of the files on some views, their poses numbered anew."""
    folder.mkdir()
    (folder / "dataset.toml").write_text((dataset / "dataset.toml").read_text())
    poses = sorted({pose for view in views.values() for pose in view})
    lines = ["camera,pose,row,col,u,v"]
    for camera, seen in views.items():
        for pose, corners in seen.items():
            lines += [f"{camera},{poses.index(pose)},{row},{col},{u},{v}" for (row, col), (u, v) in corners.items()]
    (folder / "corners.csv").write_text("\n".join([*lines, ""]))
    run = subprocess.run(
        [program, "audit", *files, folder, "--unit", "mm", "--json", "-q"], check=True, capture_output=True, text=True
    )
    return json.loads(run.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("corners", type=pathlib.Path)
    parser.add_argument("--write", type=pathlib.Path)
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    manifest = tomllib.loads((arguments.dataset / "dataset.toml").read_text())
    views = read_views(arguments.corners)
    names = [camera["name"] for camera in manifest["camera"]]
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for kind in ("all", "half"):
            (folder / kind).mkdir()
            keep = (lambda pose: True) if kind == "all" else (lambda pose: pose % 2 == 0)
            judged = (lambda pose: True) if kind == "all" else (lambda pose: pose % 2 == 1)
            chosen = {name: {p: v for p, v in views[name].items() if keep(p)} for name in names}
            others = {name: {p: v for p, v in views[name].items() if judged(p)} for name in names}
            rms, pair = calibrate(manifest, chosen, folder / kind)
            files = [*(folder / kind / f"{name}.yml" for name in names), folder / kind / "extrinsics.yml"]
            found = audit(program, arguments.dataset, others, files, folder / f"{kind}-set")
            theirs, ours = found["calibrations"][0], found["ours"]
            if kind == "all":
                for camera in theirs["cameras"]:
                    print(f"{camera['name']}: OpenCV {rms[camera['name']]:.6f} px, audit {camera['rms_px']:.6f} px")
                    assert abs(camera["rms_px"] - rms[camera["name"]]) < 5e-5 * rms[camera["name"]]
                print(f"pair: OpenCV {pair:.6f} px, audit {theirs['together_rms_px']:.6f} px")
                assert abs(theirs["together_rms_px"] - pair) < 5e-5 * pair
                if arguments.write:
                    arguments.write.mkdir(parents=True, exist_ok=True)
                    for file in files:
                        (arguments.write / file.name).write_text(file.read_text())
            else:
                print(f"pairs that OpenCV never saw: {theirs['common']}; ours, of theirs in turn: {ours['common']}")
            print(*found["conclusion"], sep="\n")


if __name__ == "__main__":
    main()
