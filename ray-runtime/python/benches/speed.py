"""A million matches from NumPy, beside the same call in Rust and beside OpenCV: CPU seconds of one thread, in one process.

    ray-runtime/python/benches/speed.sh

builds what it needs (the module with the feature `timing`, which brings the Rust call) and runs this. Each figure is
the least of several rounds, in each of which all of them are measured one after the other.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

import calib_offline
import rays
from rays._rays import RustMatches

ROOT = Path(__file__).resolve().parents[3]
MATCHES = 1_000_000
ROUNDS = 7


def seen_points(rig):
    """Pixels that see points of a box before the cameras of data/stage."""
    k = np.arange(20_000)
    spread = lambda step, extent: ((k * step) % 1.0 - 0.5) * extent
    xyz = np.stack([60 + spread(0.618, 80), 70 + spread(0.414, 80), spread(0.732, 40)], axis=-1)
    uv = [rig.project(camera, xyz) for camera in (0, 1)]
    both = np.isfinite(uv[0] + uv[1]).all(axis=1)
    repeated = -(-MATCHES // both.sum())
    return [np.ascontiguousarray(np.tile(pixels[both], (repeated, 1))[:MATCHES]) for pixels in uv]


def opencv(uv_a, uv_b):
    """OpenCV's own way with two lenses of five coefficients, those of calib-offline/benches/opencv_points.py."""
    matrix = np.array([[1500.0, 0, 640], [0, 1500, 512], [0, 0, 1]])
    lens = np.array([-0.2, 0.08, 3e-4, -2e-4, 0.01])
    turn, _ = cv2.Rodrigues(np.array([0.0, -0.5, 0.0]))
    first, second = np.eye(3, 4), np.hstack([turn, [[-210.0], [0.0], [60.0]]])

    def call():
        ideal = [cv2.undistortPoints(uv.reshape(-1, 1, 2), matrix, lens).reshape(-1, 2).T for uv in (uv_a, uv_b)]
        return cv2.triangulatePoints(first, second, *ideal)

    return call


def seconds(call):
    start = time.thread_time()
    call()
    return time.thread_time() - start


def main():
    cv2.setNumThreads(1)
    program = os.environ.get("CALIB_OFFLINE", str(ROOT / "target/release/calib-offline"))
    folder = Path(tempfile.mkdtemp())
    record = calib_offline.calibrate(ROOT / "data/stage", folder / "stage", program=program)
    calls = {}
    for form in ("speed", "size"):
        blob = folder / f"{form}.rays"
        calib_offline.run("pack", record.calibration, "--output", blob, "--prefer", form, program=program)
        rig = rays.open(blob)
        uv_a, uv_b = seen_points(rig)
        matches = RustMatches(uv_a, uv_b)
        assert rig.triangulate(uv_a, uv_b).ok.all()
        wide_a, wide_b = uv_a.astype(np.float64), uv_b.astype(np.float64)
        # Bound now: the loop goes on.
        calls |= {
            ("rust", form): lambda m=matches, r=rig: m.triangulate(r._blob),
            ("numpy", form): lambda r=rig, a=uv_a, b=uv_b: r.triangulate(a, b),
            ("numpy float64", form): lambda r=rig, a=wide_a, b=wide_b: r.triangulate(a, b),
            ("rust, sigma", form): lambda m=matches, r=rig: m.triangulate_with_covariance(r._blob),
            ("numpy, sigma", form): lambda r=rig, a=uv_a, b=uv_b: r.triangulate(a, b, sigma=True),
        }
    calls["opencv float32", ""] = opencv(uv_a, uv_b)
    calls["opencv float64", ""] = opencv(wide_a, wide_b)
    found = {name: [] for name in calls}
    for _ in range(ROUNDS):
        for name, call in calls.items():
            found[name].append(seconds(call))
    least = {name: min(all_of_it) for name, all_of_it in found.items()}
    # Whichever it does faster.
    cv = min(least["opencv float32", ""], least["opencv float64", ""])
    print(f"{MATCHES} matches, CPU seconds of one thread; numpy {np.__version__}, OpenCV {cv2.__version__}\n")
    print(f"{'OpenCV: undistortPoints twice, triangulatePoints':<50} {cv:6.3f}")
    for (name, form), value in least.items():
        if form:
            rust = least["rust, sigma" if "sigma" in name else "rust", form]
            ratios = f"{value / rust:5.2f} of the Rust call, {cv / value:5.1f} times faster than OpenCV"
            print(f"{name + ', --prefer ' + form:<50} {value:6.3f}   {ratios}")
    failed = [
        words
        for words, holds in [
            ("at most 1.1 of the Rust call", least["numpy", "speed"] <= 1.1 * least["rust", "speed"]),
            ("at most 1.1 of it with sigma", least["numpy, sigma", "speed"] <= 1.1 * least["rust, sigma", "speed"]),
            ("15 times faster than OpenCV", cv >= 15 * least["numpy", "speed"]),
            ("3 times faster with sigma", cv >= 3 * least["numpy, sigma", "speed"]),
        ]
        if not holds
    ]
    print("\n" + ("not reached: " + "; ".join(failed) if failed else "all goals reached"))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
