#!/usr/bin/env python3
"""OpenCV's detectors on a folder of images named by numbers: the points as lines `image,row,col,u,v`.

usage: opencv_targets.py FOLDER charuco ROWS COLS SQUARE MARKER DICTIONARY LEGACY
       opencv_targets.py FOLDER aprilgrid ROWS COLS UPWARDS
       opencv_targets.py FOLDER circles ROWS COLS ASYMMETRIC

Rows and columns are those of the points (of tags for aprilgrid). Circles of a grid that looks the same
after a half turn are numbered from the end that puts the first circle nearest to the image's upper left.
"""

import pathlib
import sys
import time

import cv2
import numpy as np


def charuco(rows, cols, square, marker, dictionary, legacy):
    rows, cols = int(rows), int(cols)
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    board = cv2.aruco.CharucoBoard((cols + 1, rows + 1), float(square), float(marker), known)
    board.setLegacyPattern(legacy == "1")
    detector = cv2.aruco.CharucoDetector(board)

    def find(image):
        corners, ids, _, _ = detector.detectBoard(image)
        if ids is None:
            return
        for place, number in zip(corners.reshape(-1, 2), ids.ravel()):
            yield int(number) // cols, int(number) % cols, place

    return find


def aprilgrid(rows, cols, upwards):
    rows, cols = int(rows), int(cols)
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(known, parameters)

    def find(image):
        corners, ids, _ = detector.detectMarkers(image)
        if ids is None:
            return
        for tag, number in zip(corners, ids.ravel()):
            row, col = divmod(int(number), cols)
            if row >= rows:
                continue
            if upwards == "1":
                row = rows - 1 - row
            for place, (down, right) in zip(tag.reshape(4, 2), [(0, 0), (0, 1), (1, 1), (1, 0)]):
                yield 2 * row + down, 2 * col + right, place

    return find


def circles(rows, cols, asymmetric):
    rows, cols = int(rows), int(cols)
    flags = cv2.CALIB_CB_ASYMMETRIC_GRID if asymmetric == "1" else cv2.CALIB_CB_SYMMETRIC_GRID

    def find(image):
        found, centers = cv2.findCirclesGrid(image, (cols, rows), flags=flags)
        if not found:
            found, centers = cv2.findCirclesGrid(image, (cols, rows), flags=flags | cv2.CALIB_CB_CLUSTERING)
        if not found:
            return
        for k, place in enumerate(centers.reshape(-1, 2)):
            yield k // cols, k % cols, place

    return find


def main():
    folder, kind, *rest = sys.argv[1:]
    find = {"charuco": charuco, "aprilgrid": aprilgrid, "circles": circles}[kind](*rest)
    cv2.setNumThreads(1)
    begin = time.process_time()
    for path in sorted(pathlib.Path(folder).glob("*.pgm")):
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        for row, col, place in find(image):
            print(f"{path.stem},{row},{col},{place[0]:.5f},{place[1]:.5f}")
    print(f"seconds,{time.process_time() - begin}")


main()
