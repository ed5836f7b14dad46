"""Whatever is wrong is said, and nothing ends the interpreter."""

import numpy as np
import pytest

import rays
from conftest import pixels


def test_what_is_no_blob_is_refused_with_a_remedy(golden, tmp_path):
    good = (golden / "stereo-v3-fast.rays").read_bytes()
    for content, code, words in [
        (b"", 1, "cut off"),
        (good[:-8], 1, "cut off"),
        (b"x" * 100, 2, "calib-offline pack"),
        (good[:4] + b"\x63" + good[5:], 3, "pack the calibration again"),
        (good + b"\0" * 8, 4, "damaged"),
        (good[:200] + bytes([good[200] ^ 1]) + good[201:], 5, "damaged"),
        (b' {"schema": 1, "verdict": "this is a calibration"}', 2, "rig.rays beside it"),
    ]:
        with pytest.raises(rays.BlobError, match=words) as caught:
            rays.open(content)
        assert caught.value.code == code
        path = tmp_path / "some.rays"
        path.write_bytes(content)
        with pytest.raises(ValueError, match="some.rays: the runtime refuses it"):
            rays.open(path)


def test_every_cut_and_many_flips_of_a_blob_are_refused(golden):
    good = (golden / "stereo-v4-small.rays").read_bytes()
    for length in range(0, len(good), 7):
        with pytest.raises(rays.BlobError):
            rays.open(good[:length])
    for at in range(0, len(good), 3):
        with pytest.raises(rays.BlobError):
            rays.open(good[:at] + bytes([good[at] ^ 1 << at % 8]) + good[at + 1 :])


def test_what_is_no_file_is_said(tmp_path):
    with pytest.raises(FileNotFoundError):
        rays.open(tmp_path / "none.rays")
    with pytest.raises(OSError):
        rays.open(tmp_path)
    for given in [None, 7, 1.5, ["a"]]:
        with pytest.raises(TypeError, match="path of a blob or its bytes"):
            rays.open(given)


@pytest.mark.parametrize(
    "uv, kind, words",
    [
        (5.0, ValueError, r"must end with an axis of 2: u, v"),
        ([], ValueError, r"shape \(0,\)"),
        (np.zeros((4, 3)), ValueError, r"shape \(4, 3\)"),
        (np.zeros((2, 4)), ValueError, r"shape \(2, 4\)"),
        ([[1, 2], [3]], ValueError, "no array of numbers"),
        (np.zeros((4, 2), complex), TypeError, "complex128"),
        (np.zeros((4, 2), bool), TypeError, "bool"),
        (np.full((4, 2), "1"), TypeError, "<U1"),
        (np.full((4, 2), None), TypeError, "object"),
        (np.zeros((4, 2), "datetime64[s]"), TypeError, "datetime64"),
        (np.ma.masked_less(np.zeros((4, 2)), 1), TypeError, "masked"),
        (None, TypeError, "object"),
    ],
)
def test_what_is_no_array_of_pixels_is_said(rig, uv, kind, words):
    with pytest.raises(kind, match=words):
        rig.rays(0, uv)
    with pytest.raises(kind, match=words):
        rig.triangulate(uv, pixels(4))
    with pytest.raises(kind, match=words):
        rig.triangulate(pixels(4), uv)
    if uv is not None:
        with pytest.raises(kind):
            rig.project(0, np.zeros((4, 3)), near=uv)


def test_points_have_three_coordinates(rig):
    with pytest.raises(ValueError, match="axis of 3: x, y, z"):
        rig.project(0, pixels(4))
    with pytest.raises(ValueError, match="one pixel for each point"):
        rig.project(0, np.zeros((4, 3)), near=pixels(3))


def test_matches_go_in_pairs(rig):
    with pytest.raises(ValueError, match=r"\(4, 2\) and uv_b \(5, 2\)"):
        rig.triangulate(pixels(4), pixels(5))
    # Nothing is spread over what it does not fit.
    with pytest.raises(ValueError, match="must be the same"):
        rig.triangulate(pixels(4), pixels(1)[0])


@pytest.mark.parametrize("camera, kind", [(2, IndexError), (-1, IndexError), ("top", KeyError), (0.0, TypeError), (None, TypeError)])
def test_cameras_that_are_none_are_said(rig, camera, kind):
    for ask in [
        lambda: rig.camera(camera),
        lambda: rig.rays(camera, pixels(1)),
        lambda: rig.project(camera, np.zeros(3)),
        lambda: rig.mask(camera),
        lambda: rig.has_sigma((0, camera)),
        lambda: rig.undistort_maps(camera, np.eye(3), (4, 4)),
    ]:
        with pytest.raises(kind):
            ask()
    with pytest.raises((kind, TypeError)):
        rig.triangulate(pixels(1), pixels(1), cameras=(camera, 1))


def test_a_point_takes_two_cameras(rig):
    with pytest.raises(ValueError, match="'left' twice"):
        rig.triangulate(pixels(1), pixels(1), cameras=(0, "left"))
    for cameras in [(0,), (0, 1, 1), 0, None]:
        with pytest.raises((TypeError, ValueError), match="two cameras"):
            rig.triangulate(pixels(1), pixels(1), cameras=cameras)


@pytest.mark.parametrize("noise_px", [-1.0, 1e-9, 1e9, float("nan"), float("inf")])
def test_noise_that_there_is_not_is_said(rig, noise_px):
    with pytest.raises(ValueError, match="noise of a match"):
        rig.triangulate(pixels(1), pixels(1), sigma=True, match_noise_px=noise_px)


def test_uncertainty_that_the_blob_does_not_carry_is_said(golden):
    rig = rays.open(golden / "stereo-v1.rays")
    assert not rig.has_sigma()
    assert rig.triangulate(pixels(10), pixels(10, 2)).sigma is None
    with pytest.raises(ValueError, match="--no-uncertainty"):
        rig.triangulate(pixels(10), pixels(10, 2), sigma=True)


@pytest.mark.parametrize(
    "change",
    [
        {"matrix": np.eye(2)},
        {"matrix": np.zeros((3, 3))},
        {"matrix": np.diag([0.0, 1.0, 1.0])},
        {"matrix": np.diag([1.0, 1.0, np.nan])},
        {"size": (0, 4)},
        {"size": (4, 1 << 20)},
        {"size": (4,)},
        {"rotation": 2 * np.eye(3)},
        {"rotation": np.zeros(3)},
        {"distance_mm": -1.0},
        {"distance_mm": float("nan")},
    ],
)
def test_pinholes_that_are_none_are_said(rig, change):
    arguments = {"matrix": np.diag([40.0, 40.0, 1.0]), "size": (8, 6)} | change
    with pytest.raises(ValueError):
        rig.undistort_maps(0, **arguments)


def test_the_part_in_rust_checks_for_itself(rig):
    blob = rig._blob
    good = pixels(4)
    for ask in [
        lambda: blob.rays(9, good),
        lambda: blob.rays(0, good.astype(np.int64)),
        lambda: blob.rays(0, good[0]),
        lambda: blob.rays(0, np.zeros((4, 3))),
        lambda: blob.rays(0, good[:, ::-1]),
        lambda: blob.rays(0, "x"),
        lambda: blob.triangulate((0, 1), good, good[:3], 0, None),
        lambda: blob.triangulate((0, 7), good, good, 0, None),
        lambda: blob.project(0, good, None, False),
        lambda: blob.mask(9),
        lambda: type(blob)("text"),
    ]:
        with pytest.raises((IndexError, TypeError, ValueError)):
            ask()
