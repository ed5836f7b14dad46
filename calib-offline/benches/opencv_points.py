"""OpenCV's way from a million matches to points: undistortPoints for both cameras, then triangulatePoints.

Prints the CPU seconds of the calls alone, on one thread; arguments: number of matches.
"""
import sys
import time

import cv2
import numpy as np

cv2.setNumThreads(1)
count = int(sys.argv[1])
random = np.random.default_rng(1)
camera = np.array([[1500.0, 0, 640], [0, 1500, 512], [0, 0, 1]])
distortion = np.array([-0.2, 0.08, 3e-4, -2e-4, 0.01])
turn, _ = cv2.Rodrigues(np.array([0.0, -0.5, 0.0]))
projections = [np.eye(3, 4), np.hstack([turn, [[-210.0], [0.0], [60.0]]])]
pixels = [random.uniform([100, 100], [1180, 924], (count, 1, 2)) for _ in projections]

start = time.process_time()
ideal = [cv2.undistortPoints(p, camera, distortion).reshape(-1, 2).T for p in pixels]
points = cv2.triangulatePoints(projections[0], projections[1], *ideal)
points = (points[:3] / points[3]).T
print(time.process_time() - start)
