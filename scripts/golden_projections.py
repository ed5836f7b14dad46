#!/usr/bin/env python3
"""Calibrations by other tools and what these tools project with them: calib-offline/exchange/golden.

usage: golden_projections.py PEER FOLDER        PEER: opencv, mrcal or colmap

Writes, for the peer that runs this (OpenCV, mrcal or pycolmap must be importable), FOLDER/PEER*/: files of its own format, written
by itself, and projections.csv with the columns file,camera,x,y,z,u,v: points of the camera's frame and where the tool sees them. In
COLMAP's own pixels, half a pixel from ours. The same numbers every time.
"""

import csv
import pathlib
import sys

import numpy as np

WIDTH, HEIGHT = 1280, 960
CORE = [701.25, 698.5, 648.5, 471.25]


def points(half_deg, count=24):
    """Unit directions up to an angle off axis, times distances from 0.4 to 3; a Fibonacci spiral, so that no two lie alike."""
    k = np.arange(count)
    angle = np.radians(half_deg) * np.sqrt((k + 0.5) / count)
    around = k * 2.399963229728653
    unit = np.stack([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)], axis=1)
    return unit * (0.4 + 2.6 * ((k * 7) % count) / count)[:, None]


def save(folder, rows):
    with open(folder / "projections.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow("file,camera,x,y,z,u,v".split(","))
        for name, camera, xyz, pixels in rows:
            for point, pixel in zip(xyz, pixels):
                writer.writerow([name, camera, *map(repr, map(float, point)), *map(repr, map(float, pixel))])


def opencv(folder):
    import cv2

    version = cv2.__version__.split(".")[0]
    folder = folder / f"opencv{version}"
    folder.mkdir(parents=True, exist_ok=True)
    fx, fy, cx, cy = CORE
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    fourteen = [-0.21, 0.07, 6e-4, -4e-4, -0.012, 0.05, -0.02, 0.004, 1e-3, -5e-4, -8e-4, 4e-4, 0.02, -0.03]
    rows = []
    for ending, count in (("yml", 4), ("json", 5), ("xml", 8), ("yml", 12), ("yml", 14)):
        name = f"pinhole{count}.{ending}"
        distortion = np.array(fourteen[:count])
        write(cv2, folder / name, matrix, distortion, fisheye=0)
        xyz = points(38)
        rows.append((name, "", xyz, cv2.projectPoints(xyz, np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)))
    distortion = np.array([0.03, -0.012, 0.004, -6e-4])
    write(cv2, folder / "fisheye.yml", matrix, distortion, fisheye=1)
    xyz = points(80)
    pixels = cv2.fisheye.projectPoints(xyz.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)
    rows.append(("fisheye.yml", "", xyz, pixels))
    save(folder, rows)


def write(cv2, path, matrix, distortion, fisheye):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", WIDTH)
    storage.write("image_height", HEIGHT)
    storage.write("fisheye_model", fisheye)
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", distortion)
    storage.release()


def mrcal(folder):
    import mrcal

    folder = folder / "mrcal"
    folder.mkdir(parents=True, exist_ok=True)
    eight = [-0.21, 0.07, 6e-4, -4e-4, -0.012, 0.05, -0.02, 0.004]
    models = {
        "pinhole": ("LENSMODEL_PINHOLE", [], 38),
        "opencv4": ("LENSMODEL_OPENCV4", eight[:4], 38),
        "opencv5": ("LENSMODEL_OPENCV5", eight[:5], 38),
        "opencv8": ("LENSMODEL_OPENCV8", eight, 38),
        "opencv12": ("LENSMODEL_OPENCV12", [*eight, 1e-3, -5e-4, -8e-4, 4e-4], 38),
        "stereographic": ("LENSMODEL_STEREOGRAPHIC", [], 120),
        "lonlat": ("LENSMODEL_LONLAT", [], 120),
        "latlon": ("LENSMODEL_LATLON", [], 120),
        "cahvor": ("LENSMODEL_CAHVOR", [0.02, -0.03, 1e-3, -0.04, 0.01], 38),
        "cahvore": ("LENSMODEL_CAHVORE_linearity=0.37", [0.02, -0.03, 1e-3, -0.04, 0.01, 0.02, -0.01, 0.004], 60),
    }
    for order in (2, 3):
        config = f"order={order}_Nx=14_Ny=11_fov_x_deg=120"
        shifts = 0.02 * np.sin(0.7 * np.arange(14 * 11 * 2) ** 1.1)
        models[f"splined{order}"] = (f"LENSMODEL_SPLINED_STEREOGRAPHIC_{config}", list(shifts), 40)
    rows = []
    for name, (lensmodel, numbers, half_deg) in models.items():
        intrinsics = (lensmodel, np.array([*CORE, *numbers]))
        model = mrcal.cameramodel(
            intrinsics=intrinsics, imagersize=np.array([WIDTH, HEIGHT]), extrinsics_rt_fromref=np.array([0.1, -0.2, 0.3, 0.01, -0.02, 0.03])
        )
        file = f"{name}.cameramodel"
        model.write(str(folder / file))
        # As written: mrcal keeps ten digits.
        model = mrcal.cameramodel(str(folder / file))
        xyz = points(half_deg)
        if name == "cahvore":
            # mrcal 2.2 takes any point for one at a distance of 1, though rays of CAHVORE do not meet.
            xyz /= np.linalg.norm(xyz, axis=1)[:, None]
        rows.append((file, "", xyz, mrcal.project(xyz, *model.intrinsics())))
    save(folder, rows)


def colmap(folder):
    import pycolmap

    folder = folder / "colmap"
    folder.mkdir(parents=True, exist_ok=True)
    one, two = CORE[:1] + CORE[2:], CORE
    models = {
        "SIMPLE_PINHOLE": (one, 38),
        "PINHOLE": (two, 38),
        "SIMPLE_RADIAL": ([*one, -0.05], 38),
        "RADIAL": ([*one, -0.2, 0.05], 38),
        "OPENCV": ([*two, -0.21, 0.07, 6e-4, -4e-4], 38),
        "OPENCV_FISHEYE": ([*two, 0.03, -0.012, 0.004, -6e-4], 75),
        "FULL_OPENCV": ([*two, -0.21, 0.07, 6e-4, -4e-4, -0.012, 0.05, -0.02, 0.004], 38),
        "FOV": ([*two, 0.9], 60),
        "SIMPLE_RADIAL_FISHEYE": ([*one, 0.02], 75),
        "RADIAL_FISHEYE": ([*one, 0.02, -0.005], 75),
        "THIN_PRISM_FISHEYE": ([*two, 0.03, -0.012, 6e-4, -4e-4, 0.004, -6e-4, 1e-3, -8e-4], 70),
        "RAD_TAN_THIN_PRISM_FISHEYE": ([*two, 0.03, -0.012, 0.004, -6e-4, 1e-4, -1e-5, 6e-4, -4e-4, 1e-3, -5e-4, -8e-4, 4e-4], 70),
        "SIMPLE_DIVISION": ([*one, -0.12], 50),
        "DIVISION": ([*two, -0.12], 50),
        "SIMPLE_FISHEYE": (one, 75),
        "FISHEYE": (two, 75),
        "EUCM": ([*two, 0.6, 1.1], 70),
    }
    reconstruction = pycolmap.Reconstruction()
    rows = []
    for number, (name, (numbers, half_deg)) in enumerate(models.items(), 1):
        camera = pycolmap.Camera(camera_id=number, model=name, width=WIDTH, height=HEIGHT, params=numbers)
        reconstruction.add_camera(camera)
        xyz = points(half_deg)
        rows.append(("cameras.txt", number, xyz, [camera.img_from_cam(point) for point in xyz]))
    reconstruction.write_text(str(folder))
    for path in folder.iterdir():
        if path.name != "cameras.txt":
            path.unlink()
    save(folder, rows)


if __name__ == "__main__":
    peers = {"opencv": opencv, "mrcal": mrcal, "colmap": colmap}
    if len(sys.argv) != 3 or sys.argv[1] not in peers:
        sys.exit(__doc__)
    peers[sys.argv[1]](pathlib.Path(sys.argv[2]))
