#!/usr/bin/env python3
"""Other tools on what calib-offline export wrote: lenses, maps, rectified pairs, undistorted images, clouds.

usage: read_models.py make PROGRAM DATASET FOLDER
       read_models.py mrcal FOLDER
       read_models.py opencv FOLDER

The first calibrates DATASET and writes every form to FOLDER, the others read them with the tool they are named for. Every lens is asked where it sees what the pixels of its loss map see
(calib-offline rays); that must be where our own lens sees it, to 1e-6 px. Maps are held against convertMaps bit for bit, and against remap on a picture whose
values are its coordinates; a rectified pair against measure at the distance for which it is made; undistorted images against remap.
"""

import csv
import json
import pathlib
import subprocess
import sys

import numpy as np

WITHIN_PX = 1e-6
MODELS = "pinhole4", "pinhole5", "rational8", "prism12", "tilted14", "equidistant"


def make(program, dataset, folder):
    import cv2

    program, dataset, folder = (pathlib.Path(path).resolve() for path in (program, dataset, folder))
    images = folder / "images"
    images.mkdir(parents=True, exist_ok=True)
    for path in sorted((dataset / "images").glob("*.jpg")):
        cv2.imwrite(str(images / f"{path.stem}.png"), cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    calibration = "results/calibration.json"

    def run(*arguments):
        subprocess.run([program, *map(str, arguments), "-q"], cwd=folder, check=True, stdout=subprocess.DEVNULL)

    def export(form, out, *more):
        run("export", calibration, "--format", form, "-o", out, *more)

    run("calibrate", dataset, "-o", "results")
    forms = [f"opencv-{model}" for model in MODELS]
    for model, out in zip(MODELS, forms):
        export("opencv", out, "--model", model)
    for form in ("mrcal", "mrcal-splined", "remap", "rectify"):
        export(form, form)
    export("undistort", "undistort", "--images", images)
    for form in [*forms, "mrcal", "mrcal-splined"]:
        for table in json.loads((folder / f"{form}.loss.json").read_text())["maps"]:
            write(folder / "pixels.csv", "id,u,v", [(f"{j}-{i}", u, v) for j, v in enumerate(table["v_px"]) for i, u in enumerate(table["u_px"])])
            run("rays", calibration, "pixels.csv", "--camera", table["camera"], "-o", f"rays-{form}-{table['camera']}.csv")
    rectified(folder, lambda: run("measure", calibration, "matches.csv", "-o", "points.csv"))
    export_ply = ["export", "points.csv", "--format", "ply", "-o", "points.ply"]
    run(*export_ply)
    print(f"written by {program.name}: {len(forms) + 5} forms and a cloud")


def write(path, header, rows):
    path.write_text("\n".join([header, *(",".join(str(value) for value in row) for row in rows), ""]))


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def in_view(view, points):
    """Points of the rig's frame in that of a view."""
    place = view["rig_from_view"]
    return (points - np.array(place["translation_mm"])) @ np.array(place["rotation"]).reshape(3, 3)


def rectified(folder, measure):
    """Matches of points of the plane that the rectified views show, by their maps."""
    index = json.loads((folder / "rectify/rectify.json").read_text())
    first, second = index["views"]
    maps = [np.load(folder / "rectify" / view["map"]["file"]) for view in (first, second)]
    projections = [np.array(index[key]).reshape(3, 4) for key in ("P1", "P2")]
    height, width = maps[0].shape[:2]
    rows = []
    for v in range(5, height, 23):
        for u in range(5, width, 29):
            z = first["plane_mm"]
            p1, p2 = projections
            point = np.array([(u - p1[0, 2]) * z / p1[0, 0], (v - p1[1, 2]) * z / p1[1, 1], z, 1])
            other = p2 @ point
            # The other place lies between pixels: its map is linear there, to a part of a pixel's curvature.
            u2, v2 = other[:2] / other[2]
            seen = between(maps[1], u2, v2)
            if maps[0][v, u, 0] >= 0 and seen is not None:
                rows.append((f"{u} {v} {float(u2)!r}", *map(float, maps[0][v, u]), *map(float, seen)))
    names = [view["camera"] for view in (first, second)]
    write(folder / "matches.csv", "id," + ",".join(f"u_{name},v_{name}" for name in names), rows)
    measure()


def between(table, u, v):
    height, width = table.shape[:2]
    if not (0 <= u < width - 1 and 0 <= v < height - 1):
        return None
    i, j = int(u), int(v)
    corners = table[j : j + 2, i : i + 2].astype(float)
    if (corners[..., 0] < 0).any():
        return None
    a, b = u - i, v - j
    return (corners[0, 0] * (1 - a) + corners[0, 1] * a) * (1 - b) + (corners[1, 0] * (1 - a) + corners[1, 1] * a) * b


def lattice(folder, form):
    """For each camera its place, points of the rig's frame (mm), and where our own lens sees them."""
    loss = json.loads((folder / f"{form}.loss.json").read_text())
    for table in loss["maps"]:
        points, seen = [], []
        for row in read(folder / f"rays-{form}-{table['camera']}.csv"):
            j, i = map(int, row["id"].split("-"))
            du, dv = table["du_px"][j][i], table["dv_px"][j][i]
            assert (du is None) == (row["status"] != "ok"), row
            if du is not None:
                origin, direction = (np.array([float(row[kind + axis]) for axis in "xyz"]) for kind in "od")
                points.append(origin + loss["distance_mm"] * direction)
                seen.append((table["u_px"][i] + du, table["v_px"][j] + dv))
        yield table, np.array(points), np.array(seen), loss


def compare(form, name, projected, seen, loss):
    off_px = np.abs(projected - seen).max()
    print(f"{form} {name}: {len(seen)} pixels, at most {off_px:.1e} px from ours; lost {loss['rms_px']:.2g} px RMS")
    assert len(seen) > 100 and off_px < WITHIN_PX, (form, name, off_px)


def mrcal(folder):
    import mrcal

    for form in ("mrcal", "mrcal-splined"):
        for table, points, seen, loss in lattice(folder, form):
            model = mrcal.cameramodel(str(folder / form / f"{table['camera']}.cameramodel"))
            region = model.valid_intrinsics_region()
            assert region is not None and len(region) >= 4 and np.array_equal(region[0], region[-1])
            in_camera = mrcal.transform_point_rt(model.extrinsics_rt_fromref(), points / 1000)
            compare(f"{form} in mrcal", table["camera"], mrcal.project(in_camera, *model.intrinsics()), seen, loss)


def opencv(folder):
    import cv2

    for model in MODELS:
        for table, points, seen, loss in lattice(folder, f"opencv-{model}"):
            storage = cv2.FileStorage(str(folder / f"opencv-{model}/{table['camera']}.yml"), cv2.FILE_STORAGE_READ)
            matrix, distortion = (storage.getNode(key).mat() for key in ("camera_matrix", "distortion_coefficients"))
            is_fisheye = storage.getNode("fisheye_model").real() == 1
            assert is_fisheye == (model == "equidistant")
            in_lens = (points - np.array(table["translation_mm"])) @ np.array(table["rotation"]).reshape(3, 3)
            project = cv2.fisheye.projectPoints if is_fisheye else cv2.projectPoints
            projected = project(in_lens.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, distortion.ravel())[0]
            compare(f"{model} in OpenCV {cv2.__version__}", table["camera"], projected.reshape(-1, 2), seen, loss)
    for form in ("remap", "rectify"):
        index = json.loads((folder / form / f"{form}.json").read_text())
        for view in index["views"]:
            maps(cv2, folder / form, view)
    pair(cv2, folder)
    undistorted(cv2, folder)
    cloud(folder)


def maps(cv2, folder, view):
    table, whole, fraction, mask = (np.load(folder / view[key]["file"]) for key in ("map", "fixed", "fraction", "mask"))
    made = cv2.convertMaps(table, None, cv2.CV_16SC2)
    # OpenCV has -1 px as whole numbers too; nothing else may differ.
    assert np.array_equal(made[0], whole) and np.array_equal(made[1], fraction)
    assert np.array_equal(mask == 255, (table != -1).any(-1)) and (table[mask == 0] == -1).all()
    height, width = table.shape[:2]
    # One at a time: OpenCV 5 takes two channels in 32nds of a pixel as 4 does.
    pictures = [axis.astype(np.float32) for axis in np.meshgrid(np.arange(width), np.arange(height))]
    is_inside = (mask == 255) & (table >= 0).all(-1) & (table[..., 0] <= width - 1) & (table[..., 1] <= height - 1)
    for name, arguments in (("float", (table, None)), ("fixed", (whole, fraction))):
        is_exact = name == "float" and int(cv2.__version__.split(".")[0]) >= 5
        off = max(np.abs(cv2.remap(picture, *arguments, cv2.INTER_LINEAR) - table[..., k])[is_inside].max() for k, picture in enumerate(pictures))
        print(f"{folder.name} {view['camera']}, {name} maps: {is_inside.mean():.3f} shown, remap is at most {off:.4f} px off")
        # 32nds of a pixel, and f32 of a thousand.
        assert off <= (0 if is_exact else 1 / 64) + 2e-4, off


def pair(cv2, folder):
    storage = cv2.FileStorage(str(folder / "rectify/rectify.yml"), cv2.FILE_STORAGE_READ)
    to_points = storage.getNode("Q").mat()
    index = json.loads((folder / "rectify/rectify.json").read_text())
    assert np.array_equal(to_points.ravel(), index["Q"])
    measured = [row for row in read(folder / "points.csv") if row["status"] == "ok"]
    points = np.array([[float(row[axis]) for axis in "xyz"] for row in measured])
    places = np.array([list(map(float, row["id"].split())) for row in measured])
    seen = np.column_stack([places[:, 0], places[:, 1], places[:, 0] - places[:, 2], np.ones(len(places))])
    found = seen @ to_points.T
    off_mm = np.linalg.norm(found[:, :3] / found[:, 3:] - in_view(index["views"][0], points), axis=1)
    print(f"Q of the rectified pair: {len(points)} points, {np.sqrt((off_mm**2).mean()):.5f} mm RMS from measure, at most {off_mm.max():.5f}")
    # Maps in f32 and linear between pixels: a thousandth of a pixel each.
    depth_mm = index["views"][0]["plane_mm"]
    in_depth = depth_mm**2 * abs(to_points[3, 2]) / to_points[2, 3]
    assert len(points) > 100 and off_mm.max() < 4e-3 * in_depth + 1e-3, off_mm.max()


def undistorted(cv2, folder):
    index = json.loads((folder / "remap/remap.json").read_text())
    is_exact = int(cv2.__version__.split(".")[0]) >= 5  # earlier ones take floats in 32nds of a pixel
    count = 0
    for view in index["views"]:
        table, mask = (np.load(folder / "remap" / view[key]["file"]) for key in ("map", "mask"))
        assert np.array_equal(cv2.imread(str(folder / f"undistort/mask_{view['camera']}.png"), cv2.IMREAD_UNCHANGED), mask)
        for path in sorted((folder / "undistort").glob(f"{view['camera']}*.png")):
            ours = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            theirs = cv2.remap(cv2.imread(str(folder / "images" / path.name), cv2.IMREAD_UNCHANGED).astype(np.float32), table, None, cv2.INTER_LINEAR)
            # Beyond the outermost pixels' centers OpenCV blends with the border.
            is_inside = (mask == 255) & (table >= 0).all(-1) & (table[..., 0] <= ours.shape[1] - 1) & (table[..., 1] <= ours.shape[0] - 1)
            off = np.abs(ours - theirs)[is_inside]
            count += 1
            # Half a level; and 1/64 px both ways of what a level changes over a pixel, up to 255.
            assert (ours[mask == 0] == 0).all() and off.max() < (0.51 if is_exact else 8.5), (path, off.max())
    print(f"{count} undistorted images are what remap makes of them")
    assert count > 0


def cloud(folder):
    from plyfile import PlyData

    vertices = PlyData.read(str(folder / "points.ply"))["vertex"]
    rows = [row for row in read(folder / "points.csv") if row["status"] == "ok"]
    for name in ("x", "y", "z", "gap", "sigma_x", "sigma_y", "sigma_z"):
        assert np.array_equal(vertices[name], [float(row[name]) for row in rows]), name
    print(f"plyfile: {len(rows)} points, bit for bit")


if __name__ == "__main__":
    readers = {"mrcal": mrcal, "opencv": opencv}
    match sys.argv[1:]:
        case ["make", program, dataset, folder]:
            make(program, dataset, folder)
        case [reader, folder] if reader in readers:
            readers[reader](pathlib.Path(folder))
        case _:
            sys.exit(__doc__)
