"""The bits are those of ``calib-offline measure`` and ``calib-offline rays``."""

import csv
import subprocess

import numpy as np
import pytest

import rays
from conftest import pixels

COUNT = 4000


def numbers(rows, names):
    return np.array([[np.float32(row[name] or "nan") for name in names] for row in rows], dtype=np.float32)


def same_bits(found, expected):
    """Bit by bit; anything that is not a number is alike."""
    found, expected = np.ascontiguousarray(found), np.ascontiguousarray(expected)
    assert found.dtype == expected.dtype == np.float32 and found.shape == expected.shape
    gone = np.isnan(expected)
    np.testing.assert_array_equal(np.isnan(found), gone)
    np.testing.assert_array_equal(found.view(np.uint32)[~gone], expected.view(np.uint32)[~gone])


def run(program, folder, *arguments):
    subprocess.run([program, *map(str, arguments)], cwd=folder, check=True, capture_output=True)


@pytest.mark.parametrize("noise_px", [None, 0.375])
def test_points_have_the_bits_of_measure(program, blob_path, tmp_path, noise_px):
    rig = rays.open(blob_path)
    uv_a, uv_b = pixels(COUNT, 1), pixels(COUNT, 2)
    a, b = rig.cameras
    with open(tmp_path / "matches.csv", "w") as file:
        print(f"id,u_{a},v_{a},u_{b},v_{b}", file=file)
        for k, values in enumerate(np.hstack([uv_a, uv_b])):
            print(k, *map(str, values), sep=",", file=file)
    noise = [] if noise_px is None else ["--match-noise-px", noise_px]
    run(program, tmp_path, "measure", blob_path, "matches.csv", "-o", "points.csv", *noise)
    with open(tmp_path / "points.csv") as file:
        expected = list(csv.DictReader(file))

    points = rig.triangulate(uv_a, uv_b, sigma=True, match_noise_px=noise_px)
    same_bits(points.xyz, numbers(expected, "xyz"))
    same_bits(points.gap, numbers(expected, ["gap"])[:, 0])
    same_bits(points.sigma, numbers(expected, ["sigma_x", "sigma_y", "sigma_z"]))
    assert list(points.words) == [row["status"] for row in expected]
    # All that can happen does.
    assert points.ok.sum() > 1000
    assert {"ok", "outside", "behind"} <= set(points.words)

    # The same without sigma, from float64, with the cameras by name, and in the other order but for the sign of nothing.
    plain = rig.triangulate(uv_a.astype(np.float64), uv_b, cameras=(a, b))
    same_bits(plain.xyz, points.xyz)
    same_bits(plain.gap, points.gap)
    np.testing.assert_array_equal(plain.status, points.status)
    assert plain.sigma is None and plain.covariance is None


def test_rays_have_the_bits_of_the_program(program, blob_path, tmp_path):
    rig = rays.open(blob_path)
    uv = pixels(COUNT)
    with open(tmp_path / "pixels.csv", "w") as file:
        print("id,u,v", file=file)
        for k, values in enumerate(uv):
            print(k, *map(str, values), sep=",", file=file)
    for camera in rig.cameras:
        run(program, tmp_path, "rays", blob_path, "--camera", camera, "pixels.csv", "-o", "rays.csv", "--force")
        with open(tmp_path / "rays.csv") as file:
            expected = list(csv.DictReader(file))
        origins, directions, status = rig.rays(camera, uv)
        assert [rays.Status(s).word for s in status] == [row["status"] for row in expected]
        assert 1000 < (status == rays.OK).sum() < COUNT
        # The program gives lines in f64 with directions of length 1; the runtime's are not normalized.
        lengths = np.linalg.norm(directions.astype(np.float64), axis=1, keepdims=True)
        expected_directions = numbers(expected, ["dx", "dy", "dz"])
        ok = status == rays.OK
        # Half of an f32's last digit in each of two roundings.
        np.testing.assert_allclose((directions / lengths)[ok], expected_directions[ok], rtol=0, atol=1.2e-7)
        expected_origins = numbers(expected, ["ox", "oy", "oz"]).astype(np.float64)
        # Any point of the line may stand for it: the distance between the two lines.
        across = np.cross(origins.astype(np.float64) - expected_origins, directions / lengths)
        size = np.abs(expected_origins[ok]).max()
        assert np.linalg.norm(across[ok], axis=1).max() < size * 3e-7


def test_self_tests_of_every_golden_blob_pass(golden):
    for path in sorted(golden.glob("*.rays")):
        assert rays.open(path).self_test() > 0
