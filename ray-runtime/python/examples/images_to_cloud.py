# %% [markdown]
# # From images to a point cloud
# Calibrates the stereo pair of `data/opencv-stereo` from its images, rectifies one pair of them with the calibration, matches it
# densely, and measures every match with its predicted standard deviation. Run it cell by cell, or as a whole:
#
#     environment=$(scripts/python-env.sh --example)
#     CALIB_OFFLINE=target/release/calib-offline "$environment/bin/python" ray-runtime/python/examples/images_to_cloud.py cloud.png

# %%
import sys
import tempfile
from pathlib import Path

import cv2
import matplotlib
import numpy as np

import calib_offline

if "ipykernel" not in sys.modules:
    matplotlib.use("Agg")
import matplotlib.pyplot as plt

repository = Path(__file__).resolve().parents[3] if "__file__" in globals() else Path.cwd()
dataset = repository / "data/opencv-stereo"

# %% [markdown]
# ## Calibrate
# The program writes its results into a folder; the record says what they are worth.

# %%
record = calib_offline.calibrate(dataset, Path(tempfile.mkdtemp()) / "results")
print(f"verdict: {record.grade}")
for reason in record.reasons:
    print(" ", reason)
rig = record.rig()
print(rig, "in the frame:", rig.frame)

# %% [markdown]
# ## Rectify
# Two ideal pinholes that look the same way, at right angles to the line between the cameras, so that both see a point in the same
# row. The ray field says where in the images their pixels are.

# %%
left, right = (rig.camera(name) for name in rig.cameras)
width, height = left.width, left.height
baseline = right.rig_from_camera[:3, 3] - left.rig_from_camera[:3, 3]
x = baseline / np.linalg.norm(baseline)
ahead = left.rig_from_camera[:3, 2] + right.rig_from_camera[:3, 2]
y = np.cross(ahead, x)
y /= np.linalg.norm(y)
common_from_rig = np.stack([x, y, np.cross(x, y)])

# A pinhole of the cameras' own scale, its middle in the image's.
focal_px = np.mean([rig.pinhole_matrix(name)[[0, 1], [0, 1]] for name in rig.cameras])
matrix = np.array([[focal_px, 0, (width - 1) / 2], [0, focal_px, (height - 1) / 2], [0, 0, 1]])
maps, images = [], []
for name, file in zip(rig.cameras, ("left01.jpg", "right01.jpg")):
    rotation = common_from_rig @ rig.camera(name).rig_from_camera[:3, :3]
    maps.append(rig.undistort_maps(name, matrix, (width, height), rotation=rotation))
    image = cv2.imread(str(dataset / "images" / file), cv2.IMREAD_GRAYSCALE)
    images.append(cv2.remap(image, *(np.nan_to_num(m, nan=-1.0) for m in maps[-1]), cv2.INTER_LINEAR))

# %% [markdown]
# ## Match
# OpenCV's semi-global matcher gives a shift along the row for every pixel of the left image; the maps lead both pixels of a
# match back to the images that were taken. A chessboard looks the same one square further, so the distances at which something
# is expected keep the matcher from it.

# %%
near_mm, far_mm = 250.0, 650.0
shifts_px = focal_px * np.linalg.norm(baseline) / np.array([far_mm, near_mm])
matcher = cv2.StereoSGBM_create(
    minDisparity=int(shifts_px[0]),
    numDisparities=16 * int(np.ceil((shifts_px[1] - shifts_px[0]) / 16)),
    blockSize=7,
    P1=8 * 49,
    P2=32 * 49,
    disp12MaxDiff=1,
    uniquenessRatio=10,
    speckleWindowSize=200,
    speckleRange=2,
)
shift = matcher.compute(*images).astype(np.float32) / 16
v, u = np.indices(shift.shape, dtype=np.float32)
uv_left = np.stack(maps[0], axis=-1)
uv_right = np.stack([cv2.remap(m, u - shift, v, cv2.INTER_LINEAR, borderValue=np.nan) for m in maps[1]], axis=-1)
found = (shift >= shifts_px[0]) & np.isfinite(uv_left + uv_right).all(axis=-1)
uv_left, uv_right, gray = uv_left[found], uv_right[found], images[0][found]
u, v = u[found], v[found]

# %% [markdown]
# ## Measure
# A matcher is not as exact as the corners of a calibration: a third of a pixel is about right for this one. Matches of
# rectified rows have no gap, so that a wrong match shows in none; what its sigma says holds for a right one.

# %%
points = rig.triangulate(uv_left, uv_right, sigma=True, match_noise_px=0.3)
for status in np.unique(points.words):
    print(f"{status}: {np.count_nonzero(points.words == status)}")
sigma = np.linalg.norm(points.sigma, axis=1)
good = points.ok
print(f"{np.count_nonzero(good)} points, known to {np.median(sigma[good]):.2f} mm (median of sigma)")
xyz = (points.xyz[good] - left.rig_from_camera[:3, 3]) @ common_from_rig.T
gray = gray[good]

# %% [markdown]
# ## Look

# %%
figure = plt.figure(figsize=(14, 6), layout="constrained")
picture = figure.add_subplot(1, 2, 1)
picture.imshow(images[0], cmap="gray")
shown = picture.scatter(u[good][::20], v[good][::20], c=sigma[good][::20], s=1, cmap="viridis", vmax=np.percentile(sigma[good], 95))
picture.set(title="left image, rectified", xlabel="u, px", ylabel="v, px")
figure.colorbar(shown, ax=picture, label="predicted standard deviation, mm", shrink=0.7)
cloud = figure.add_subplot(1, 2, 2, projection="3d")
some = slice(None, None, max(1, len(xyz) // 40_000))
near = xyz[:, 2] < np.percentile(xyz[:, 2], 98)
cloud.scatter(*(xyz[near][some][:, k] for k in (0, 2)), -xyz[near][some][:, 1], c=gray[near][some], s=1, cmap="gray", vmin=0, vmax=255)
cloud.set(title=f"{np.count_nonzero(good)} points", xlabel="x, mm", ylabel="z, mm", zlabel="-y, mm")
cloud.set_box_aspect(np.ptp(np.stack([xyz[near][:, 0], xyz[near][:, 2], xyz[near][:, 1]]), axis=1))
cloud.view_init(elev=20, azim=-70)
target = sys.argv[1] if len(sys.argv) > 1 and "ipykernel" not in sys.modules else None
if target:
    figure.savefig(target, dpi=110)
    print("written to", target)
else:
    plt.show()
