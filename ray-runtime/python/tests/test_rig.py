"""What the rig answers, and how it takes its arrays."""

import sys
import threading
import tracemalloc

import numpy as np
import pytest

import rays
from conftest import pixels


def test_cameras_are_named_in_order(rig):
    assert rig.cameras == ("left", "right")
    left = rig.camera(0)
    assert left == left and (left.name, left.width, left.height) == ("left", 64, 48)
    assert rig.camera("right").name == "right"
    pose = left.rig_from_camera
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-6)
    assert rig.max_error_px > 0 and rig.working_distance_mm > 0 and len(rig.identity) == 32
    assert "left" in repr(rig)


def test_bytes_and_their_buffers_open_like_the_file(golden):
    path = golden / "stereo-v3-fast.rays"
    content = path.read_bytes()
    uv = pixels(100)
    expected = rays.open(str(path)).rays(0, uv)
    for given in [content, bytearray(content), memoryview(content), np.frombuffer(content, dtype=np.uint8)]:
        for found, wanted in zip(rays.open(given).rays(0, uv), expected):
            np.testing.assert_array_equal(found, wanted)


def test_shapes_follow_those_of_the_pixels(rig):
    uv_a, uv_b = pixels(24, 1), pixels(24, 2)
    flat = rig.triangulate(uv_a, uv_b, covariance=True)
    assert flat.xyz.shape == (24, 3) and flat.covariance.shape == (24, 3, 3) and len(flat) == 24
    for lead in [(2, 3, 4), (24,), (1, 24)]:
        points = rig.triangulate(uv_a.reshape(*lead, 2), uv_b.reshape(*lead, 2), sigma=True)
        assert points.xyz.shape == points.sigma.shape == (*lead, 3)
        assert points.gap.shape == points.status.shape == points.ok.shape == points.words.shape == lead
        np.testing.assert_array_equal(points.xyz.reshape(-1, 3), flat.xyz)
    origins, directions, status = rig.rays("left", (30.0, 20.5))
    assert origins.shape == directions.shape == (3,) and status.shape == () and status == rays.OK
    assert rig.project(0, origins + 500 * directions).shape == (2,)


def test_no_pixels_make_no_points(rig):
    none = np.empty((0, 2))
    points = rig.triangulate(none, none, covariance=True)
    assert points.xyz.shape == (0, 3) and points.covariance.shape == (0, 3, 3) and points.status.shape == (0,)
    assert rig.project(0, np.empty((0, 3))).shape == (0, 2)
    assert rig.rays(0, np.empty((3, 0, 2), np.float32))[0].shape == (3, 0, 3)


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a.astype(np.float64),
        lambda a: np.asfortranarray(a),
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: a[::-1][::-1],
        lambda a: a.astype(">f4"),
        lambda a: a.astype(np.longdouble),
        lambda a: a.tolist(),
        lambda a: np.hstack([a, a])[:, :2],
    ],
)
def test_however_pixels_lie_in_memory_the_points_are_the_same(rig, change):
    uv_a, uv_b = pixels(500, 1), pixels(500, 2)
    expected = rig.triangulate(uv_a, uv_b)
    found = rig.triangulate(change(uv_a), change(uv_b))
    np.testing.assert_array_equal(found.xyz, expected.xyz)
    np.testing.assert_array_equal(found.status, expected.status)


def test_whole_numbers_are_pixels(rig):
    whole = np.array([[30, 20], [10, 10]])
    np.testing.assert_array_equal(rig.rays(0, whole)[1], rig.rays(0, whole.astype(np.float32))[1])
    np.testing.assert_array_equal(rig.rays(0, whole.astype(np.uint16))[1], rig.rays(0, whole.astype(np.float16))[1])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rows_that_lie_together_are_not_copied(rig, dtype):
    uv = pixels(200_000).astype(dtype)
    uv.flags.writeable = False
    rig.rays(0, uv[:1])
    tracemalloc.start()
    try:
        *_, status = rig.rays(0, uv)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # The answers take no more than 25 bytes a pixel, which Rust allocates; a copy of the pixels would be Python's.
    assert len(status) == len(uv) and peak < uv.nbytes / 10


def test_other_threads_run_meanwhile(rig):
    """A thread that only counts goes on while another measures: with the interpreter's lock held it would stand still."""
    uv_a, uv_b = (np.tile(pixels(1000, seed), (1500, 1)) for seed in (1, 2))
    count, stop = [0], threading.Event()

    def counting():
        while not stop.is_set():
            count[0] += 1

    interval = sys.getswitchinterval()
    # Turns of 10 us: what is counted in those before and after the call is little.
    sys.setswitchinterval(1e-5)
    thread = threading.Thread(target=counting)
    thread.start()
    try:
        before = count[0]
        points = rig.triangulate(uv_a, uv_b, sigma=True)
        counted = count[0] - before
    finally:
        stop.set()
        thread.join()
        sys.setswitchinterval(interval)
    assert len(points) == len(uv_a) and counted > 10_000


def test_what_is_no_pixel_has_no_ray(rig):
    uv = np.array([[np.nan, 20], [30, np.inf], [-np.inf, 20], [1e30, 20], [-1, 20], [30, 20]])
    origins, directions, status = rig.rays(0, uv)
    assert list(status) == [rays.OUTSIDE] * 5 + [rays.OK]
    assert np.isnan(origins[:5]).all() and np.isnan(directions[:5]).all() and np.isfinite(directions[5]).all()
    points = rig.triangulate(uv, np.tile([33.0, 21.0], (6, 1)), covariance=True)
    assert list(points.words) == ["outside"] * 5 + ["ok"]
    for numbers in [points.xyz, points.gap, points.sigma, points.covariance]:
        assert np.isnan(numbers[:5]).all() and np.isfinite(numbers[5]).all()


def test_covariance_goes_with_sigma_and_grows_with_noise(rig):
    uv_a, uv_b = pixels(2000, 1), pixels(2000, 2)
    points = rig.triangulate(uv_a, uv_b, covariance=True)
    ok = points.ok
    np.testing.assert_array_equal(points.sigma, rig.triangulate(uv_a, uv_b, sigma=True).sigma)
    diagonal = np.diagonal(points.covariance, axis1=1, axis2=2)
    np.testing.assert_array_equal(np.sqrt(diagonal[ok]), points.sigma[ok])
    np.testing.assert_array_equal(points.covariance[ok], points.covariance[ok].swapaxes(1, 2))
    none, some = (rig.triangulate(uv_a, uv_b, sigma=True, match_noise_px=px).sigma[ok] for px in (0.0, 3.0))
    assert (none <= some).all() and (some.mean() > none.mean())
    # Exchanged cameras: the same point and sigma up to round-off.
    turned = rig.triangulate(uv_b, uv_a, cameras=("right", "left"), sigma=True)
    np.testing.assert_array_equal(turned.status, points.status)
    np.testing.assert_allclose(turned.sigma[ok], points.sigma[ok], rtol=1e-4)


def test_a_point_of_a_ray_is_seen_by_its_pixel(rig):
    uv = pixels(1000)
    for camera in rig.cameras:
        origins, directions, status = rig.rays(camera, uv)
        ok = status == rays.OK
        unit = directions[ok] / np.linalg.norm(directions[ok], axis=1, keepdims=True)
        xyz = origins[ok] + 600.0 * unit
        seen = rig.project(camera, xyz)
        found = np.isfinite(seen[:, 0])
        # Beside the edge of the calibrated area a step may leave it.
        assert found.mean() > 0.9
        np.testing.assert_allclose(seen[found], uv[ok][found], atol=0.002)
        near = rig.project(camera, xyz.astype(np.float64), near=uv[ok] + np.float32(0.5))
        both = found & np.isfinite(near[:, 0])
        assert both.mean() > 0.9
        np.testing.assert_allclose(near[both], seen[both], atol=0.002)
    assert np.isnan(rig.project(0, [[0.0, 0.0, -1e6], [np.nan, 0.0, 0.0]])).all()


def test_the_mask_says_which_pixels_have_rays(blob_path):
    rig = rays.open(blob_path)
    masks = [rig.mask(camera) for camera in rig.cameras]
    assert any(0 < mask.sum() < mask.size for mask in masks)
    for camera, mask in zip(rig.cameras, masks):
        assert mask.shape == (48, 64) and mask.dtype == np.bool_
        v, u = np.mgrid[:48, :64]
        *_, status = rig.rays(camera, np.stack([u, v], axis=-1))
        np.testing.assert_array_equal(status == rays.OK, mask)


def test_maps_lead_to_the_pixels_that_see_the_pinholes_points(rig):
    name = "left"
    camera = rig.camera(name)
    matrix = np.array([[40.0, 0, 15.5], [0, 40.0, 11.5], [0, 0, 1]])
    center = np.array([camera.region[0] + camera.region[2] / 2, camera.region[1] + camera.region[3] / 2])
    _, ahead, _ = rig.rays(name, center)
    # Looks where the middle of the sensor looks.
    z = camera.rig_from_camera[:3, :3].T @ ahead.astype(np.float64)
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    u, v = rig.undistort_maps(name, matrix, (32, 24), rotation=rotation, distance_mm=700.0)
    assert u.shape == v.shape == (24, 32) and u.dtype == v.dtype == np.float32 and u.flags.c_contiguous
    found = np.isfinite(u)
    assert found.sum() > 100
    rows, columns = np.nonzero(found)
    in_pinhole = 700.0 * (np.linalg.inv(matrix) @ np.stack([columns, rows, np.ones(len(rows))])).T
    xyz = in_pinhole @ rotation @ camera.rig_from_camera[:3, :3].T + camera.rig_from_camera[:3, 3]
    np.testing.assert_allclose(np.stack([u[found], v[found]], -1), rig.project(name, xyz), atol=0.01)
