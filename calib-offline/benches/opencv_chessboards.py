#!/usr/bin/env python3
"""OpenCV's classic chessboard finder on a folder of images, as its users call it, on one core.

usage: opencv_chessboards.py FOLDER ROWS COLS

Prints the seconds of CPU that reading, finding and refining took, and how many boards were found whole.
"""

import pathlib
import sys
import time

import cv2


def main():
    folder, rows, cols = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    cv2.setNumThreads(1)
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
    boards = 0
    begin = time.process_time()
    for path in sorted(pathlib.Path(folder).iterdir()):
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        found, corners = cv2.findChessboardCorners(image, (cols, rows))
        if found:
            cv2.cornerSubPix(image, corners, (11, 11), (-1, -1), until)
            boards += 1
    print(time.process_time() - begin, boards)


if __name__ == "__main__":
    main()
