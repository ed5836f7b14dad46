#!/usr/bin/env bash
# Tags of Kalibr's AprilGrid before other readers: OpenCV 5.0.0 (OPENCV=4.10.0.84 and OPENCV=4.14.0.94 alike), AprilTag 3
# (pupil-apriltags 1.0.4.post11), aprilgrid 0.5.0.
#
# Kalibr prints a tag's code within two cells of black (createTargetPDF.py of kalibr 1f60227: borderBits=2), AprilTag and
# OpenCV within one; the number is the same. Expected: a reader of the one kind reads none of the other, or all in the
# right place.
# Instead: OpenCV with its default (markerBorderBits = 1) reads the right numbers of every tag with two cells, and gives as
# its corners a square one cell further in: of tags of 80 px, 6 px aside along each axis, refined or not. aprilgrid's
# t36h11 reads those with one cell and gives corners one cell further out. Only AprilTag 3 reads none. And OpenCV's
# dictionaries hold every tag of the family upside down, against AprilTag's own, so that "first corner" is another one.
# So: our reader tries both borders, takes corners where a tag's black meets the squares between the tags, and rests nothing
# on a tag's turn (recording/src/detect/printed/april_grid.rs); `target --border-bits 2` prints Kalibr's form.
#
# Output seen:
#   two cells, OpenCV, markerBorderBits 1: 8 of 8 read, corners off by 6.5 px
#   two cells, OpenCV, markerBorderBits 2: 8 of 8 read, corners off by 0.2 px
#   two cells, AprilTag 3: 0 of 8 read
#   two cells, aprilgrid t36h11: 8 of 8 read, corners off by 0.1 px
#   one cell, aprilgrid t36h11: 8 of 8 read, corners off by 8.5 px
#   upside down in OpenCV's dictionary: 587 of 587
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/python"
"$folder/python/bin/pip" install --quiet opencv-python-headless==${OPENCV:-5.0.0.93} pupil-apriltags==1.0.4.post11
# Without what they ask for: that would be another OpenCV in the place of this one.
"$folder/python/bin/pip" install --quiet --no-deps aprilgrid==0.5.0 moms-apriltag==2023.1.15 colorama==0.4.6
cat >"$folder/finding.py" <<'PYTHON'
import sys

import aprilgrid
import cv2
import moms_apriltag
import numpy as np
from pupil_apriltags import Detector

FAMILY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
COUNT, CELL, MARGIN = 8, 8, 24


def photograph(border):
    """Tags side by side, a little blurred, and the side of each in px."""
    tags = [cv2.aruco.generateImageMarker(FAMILY, i, 6 + 2 * border, borderBits=border) for i in range(COUNT)]
    tags = [np.pad(np.kron(tag, np.ones((CELL, CELL))), MARGIN, constant_values=255) for tag in tags]
    image = cv2.GaussianBlur(20 + 0.8 * np.hstack(tags), (0, 0), 0.8)
    return image.round().astype(np.uint8), CELL * (6 + 2 * border)


def report(name, found, side):
    """`found`: numbers and corners. The mean over corners of how far they are off along an axis."""
    off = []
    for number, corners in found:
        low = np.array([MARGIN + number * (side + 2 * MARGIN), MARGIN]) - 0.5
        truth = low + side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        corners = np.reshape(corners, (4, 2))
        nearest = np.linalg.norm(corners[:, None] - truth[None], axis=2).argmin(1)
        off.append(np.abs(corners - truth[nearest]).mean())
    line = f"{name}: {len(off)} of {COUNT} read"
    print(line + (f", corners off by {np.mean(off):.1f} px" if off else ""))
    return len(off), np.mean(off) if off else 0.0


def opencv(image, border):
    settings = cv2.aruco.DetectorParameters()
    settings.markerBorderBits = border
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    corners, numbers, _ = cv2.aruco.ArucoDetector(FAMILY, settings).detectMarkers(image)
    return zip(numbers.ravel(), corners)


def grid(image):
    return [(tag.tag_id, tag.corners) for tag in aprilgrid.Detector("t36h11").detect(image)]


image, side = photograph(2)
default = report("two cells, OpenCV, markerBorderBits 1", opencv(image, 1), side)
told = report("two cells, OpenCV, markerBorderBits 2", opencv(image, 2), side)
tags = Detector(families="tag36h11", quad_decimate=1.0).detect(image)
own = report("two cells, AprilTag 3", [(tag.tag_id, tag.corners - 0.5) for tag in tags], side)
kalibr = report("two cells, aprilgrid t36h11", grid(image), side)
image, side = photograph(1)
one = report("one cell, aprilgrid t36h11", grid(image), side)
published = moms_apriltag.TagGenerator2("tag36h11")
turned = sum(
    np.array_equal(np.rot90(published.generate(i), 2) > 0, cv2.aruco.generateImageMarker(FAMILY, i, 8) > 0)
    for i in range(len(FAMILY.bytesList))
)
print(f"upside down in OpenCV's dictionary: {turned} of {len(FAMILY.bytesList)}")
right = [told, kalibr]
wrong = [default, one]
as_stated = all(n == COUNT and off < 0.5 for n, off in right) and all(n == COUNT and off > 4 for n, off in wrong)
if not (as_stated and own[0] == 0 and turned == 587):
    sys.exit("changed: look at this finding again")
PYTHON
"$folder/python/bin/python" "$folder/finding.py"
