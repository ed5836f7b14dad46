"""A rig and its cameras."""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import Optional, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import rows
from ._points import Points
from ._rays import Blob

CameraName = Union[int, str]
"""A camera by its place in ``Rig.cameras`` or by its name."""


@dataclass(frozen=True)
class Camera:
    """What a blob says of a camera."""

    name: str
    """Unique in the rig."""
    width: int
    """Columns of the sensor, px."""
    height: int
    """Rows of the sensor, px."""
    region: Tuple[int, int, int, int]
    """The part of the sensor that was calibrated: first column, first row, columns, rows, px."""
    is_central: bool
    """Whether all rays start in one point."""
    rig_from_camera: NDArray[np.float64]
    """Maps points in the camera's frame (z into the scene) to the rig's, mm; shape (4, 4)."""

    def __hash__(self) -> int:
        return hash(self.name)


class Rig:
    """A calibrated rig, made by :func:`rays.open`. It is only read: any number of threads may use it."""

    def __init__(self, blob: Blob) -> None:
        self._blob = blob
        self._cameras = tuple(_camera(*facts) for facts in blob.cameras())
        facts = blob.facts()
        self._frame, self._written_by, self._identity = facts[:3]
        self._max_error_px, self._working_distance_mm, self._match_noise_px = facts[3:]

    @property
    def cameras(self) -> Tuple[str, ...]:
        """The names of the cameras, in order."""
        return tuple(camera.name for camera in self._cameras)

    def camera(self, camera: CameraName) -> Camera:
        """What the blob says of a camera, by its index or name.

        Raises:
            IndexError, KeyError: there is no such camera.
        """
        return self._cameras[self._index(camera)]

    @property
    def frame(self) -> str:
        """The frame of rays and points, in words."""
        return self._frame

    @property
    def written_by(self) -> str:
        """Program and version that wrote the blob."""
        return self._written_by

    @property
    def identity(self) -> str:
        """Identifies the calibration, as ``calib-offline inspect`` shows it."""
        return bytes(self._identity).hex()

    @property
    def max_error_px(self) -> float:
        """No calibrated pixel is further than this from the field that was packed, px."""
        return self._max_error_px

    @property
    def working_distance_mm(self) -> float:
        """The distance for which that holds if a camera is not central, mm."""
        return self._working_distance_mm

    @property
    def match_noise_px(self) -> Optional[float]:
        """How noisy the blob says that the pixels of matches are, px; None: as the corners of the calibration."""
        return self._match_noise_px

    def has_sigma(self, cameras: Tuple[CameraName, CameraName] = (0, 1)) -> bool:
        """Whether the uncertainty of points of two cameras is known."""
        pair = sorted(self._index(camera) for camera in cameras)
        return pair in [sorted(known) for known in self._blob.uncertain_pairs()]

    def self_test(self) -> int:
        """Compares this machine's bits with those of the machine that packed the blob; how many questions there were.

        Raises:
            RuntimeError: one is answered with other bits.
        """
        number, passed = self._blob.self_test()
        if not passed:
            raise RuntimeError(f"self-test {number} of the blob gives other bits on this machine")
        return number

    def rays(
        self, camera: CameraName, uv: ArrayLike
    ) -> Tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8]]:
        """The rays of pixels, in the rig's frame.

        Args:
            camera: index or name.
            uv: pixels (u, v), px; shape (..., 2).

        Returns:
            ``origins`` (..., 3), mm; ``directions`` (..., 3), into the scene and not normalized; ``status`` (...),
            ``OK`` or ``OUTSIDE``. NaN where a pixel has no ray.
        """
        index = self._index(camera)
        pixels, shape = rows("uv", uv, 2)
        origins, directions, status = self._blob.rays(index, pixels)
        return origins.reshape(*shape, 3), directions.reshape(*shape, 3), status.reshape(shape)

    def triangulate(
        self,
        uv_a: ArrayLike,
        uv_b: ArrayLike,
        cameras: Tuple[CameraName, CameraName] = (0, 1),
        sigma: bool = False,
        *,
        covariance: bool = False,
        match_noise_px: Optional[float] = None,
    ) -> Points:
        """The points that two cameras see.

        Args:
            uv_a: pixels (u, v) of the first of the two cameras, px; shape (..., 2).
            uv_b: those of the second one that belong to them; the same shape.
            cameras: which two, by index or name.
            sigma: whether to predict the standard deviations too; it costs about five times the point.
            covariance: whether to give the covariance too; it includes ``sigma``.
            match_noise_px: how noisy a pixel coordinate is, px (standard deviation), whatever the blob says; 0, or 1e-6 to
                1000. It changes ``sigma`` and ``covariance`` alone.

        Returns:
            :class:`Points`. What the uncertainty holds: what the calibration leaves open (a rigid motion of the whole
            rig taken out) and the noise of the pixels.

        Raises:
            ValueError: shapes that do not fit, or an uncertainty that the rig does not carry.
        """
        try:
            first, second = (self._index(camera) for camera in cameras)
        except (TypeError, ValueError) as error:
            raise type(error)(f"cameras must be two cameras, found {cameras!r}") from None
        if first == second:
            raise ValueError(f"a point takes two cameras, found {self.cameras[first]!r} twice")
        pixels_a, shape = rows("uv_a", uv_a, 2)
        pixels_b, shape_b = rows("uv_b", uv_b, 2)
        if shape != shape_b:
            raise ValueError(f"uv_a has the shape {(*shape, 2)} and uv_b {(*shape_b, 2)}: they must be the same")
        depth = 2 if covariance else int(bool(sigma))
        if depth and not self.has_sigma((first, second)):
            a, b = self.cameras[first], self.cameras[second]
            raise ValueError(
                f"the rig says nothing of the uncertainty of {a!r} and {b!r} (pack without --no-uncertainty, or ask without sigma)"
            )
        if match_noise_px is not None:
            match_noise_px = float(match_noise_px)
        xyz, gap, status, sigma_mm, covariance_mm2 = self._blob.triangulate(
            (first, second), pixels_a, pixels_b, depth, match_noise_px
        )
        return Points(
            xyz=xyz.reshape(*shape, 3),
            gap=gap.reshape(shape),
            status=status.reshape(shape),
            sigma=None if sigma_mm is None else sigma_mm.reshape(*shape, 3),
            covariance=None if covariance_mm2 is None else covariance_mm2.reshape(*shape, 3, 3),
        )

    def project(self, camera: CameraName, xyz: ArrayLike, near: Optional[ArrayLike] = None) -> NDArray[np.float32]:
        """The pixels of a camera that see points, to some 0.001 px.

        Args:
            camera: index or name.
            xyz: points in the rig's frame, mm; shape (..., 3).
            near: pixels nearby from which to search, px, such as those of the frame before; shape (..., 2). Without them
                it takes about half as long again.

        Returns:
            Pixels (u, v), px; shape (..., 2). NaN where no calibrated pixel was found to see the point.
        """
        index = self._index(camera)
        points, shape = rows("xyz", xyz, 3)
        starts = None
        if near is not None:
            starts, shape_near = rows("near", near, 2)
            if shape_near != shape:
                raise ValueError(f"xyz has the shape {(*shape, 3)} and near {(*shape_near, 2)}: one pixel for each point")
        return self._blob.project(index, points, starts, False).reshape(*shape, 2)

    def mask(self, camera: CameraName) -> NDArray[np.bool_]:
        """Which pixels of a camera's sensor have a ray; shape (height, width)."""
        return self._blob.mask(self._index(camera))

    def pinhole_matrix(self, camera: CameraName) -> NDArray[np.float64]:
        """A pinhole for :meth:`undistort_maps` that looks along the camera's z and has its scale there; shape (3, 3).

        It is a choice, not a fit: axis and scale are those of the pixel whose ray is nearest to the camera's z axis.

        Raises:
            ValueError: no calibrated pixel looks along z.
        """
        index = self._index(camera)
        found = self._cameras[index]
        pose = found.rig_from_camera
        places = self.working_distance_mm * _CROSS @ pose[:3, :3].T + pose[:3, 3]
        pixels = self.project(index, places).astype(np.float64)
        if not np.isfinite(pixels).all():
            raise ValueError(f"no calibrated pixel of {found.name!r} looks along its z axis: choose a matrix")
        center, left, right, up, down = pixels
        focal = [(right - left)[0], (down - up)[1]] / np.array(2 * _CROSS_STEP)
        return np.array([[focal[0], 0.0, center[0]], [0.0, focal[1], center[1]], [0.0, 0.0, 1.0]])

    def undistort_maps(
        self,
        camera: CameraName,
        matrix: ArrayLike,
        size: Tuple[int, int],
        rotation: Optional[ArrayLike] = None,
        distance_mm: Optional[float] = None,
    ) -> Tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Where each pixel of an ideal pinhole's image is in the camera's: the maps of ``cv2.remap``.

        Args:
            camera: index or name.
            matrix: of the pinhole, px; shape (3, 3), the last row 0, 0, 1. :meth:`pinhole_matrix` is one.
            size: width and height of its image, px.
            rotation: maps directions in the camera's frame to the pinhole's; shape (3, 3). None: they look alike.
            distance_mm: how far along its z axis the pinhole's image is right, if the camera is not central, mm. None: the
                working distance.

        Returns:
            u and v of the camera, px; shape (height, width) each. NaN where no calibrated pixel sees it.
        """
        index = self._index(camera)
        inverse = _inverse(_square("matrix", matrix))
        turn = np.eye(3) if rotation is None else _square("rotation", rotation)
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-6):
            raise ValueError("rotation is none: its rows are not of length 1 at right angles")
        width, height = (operator.index(extent) for extent in size)
        if not (0 < width <= 32768 and 0 < height <= 32768):
            raise ValueError(f"size is {width} x {height} px; it must be 1 to 32768 each")
        distance = self.working_distance_mm if distance_mm is None else float(distance_mm)
        if not (distance > 0.0 and np.isfinite(distance)):
            raise ValueError(f"distance_mm is {distance}; it must be above 0")
        pose = self._cameras[index].rig_from_camera
        rig_from_pixel = distance * pose[:3, :3] @ turn.T @ inverse
        maps = np.empty((height, width, 2), dtype=np.float32)
        u = np.arange(width, dtype=np.float64)
        for v in range(height):
            pixels = np.stack([u, np.full(width, float(v)), np.ones(width)], axis=-1)
            points = pixels @ rig_from_pixel.T + pose[:3, 3]
            maps[v] = self._blob.project(index, points, None, True)
        return np.ascontiguousarray(maps[..., 0]), np.ascontiguousarray(maps[..., 1])

    def __repr__(self) -> str:
        return f"<rays.Rig of {', '.join(self.cameras)}>"

    def _index(self, camera: CameraName) -> int:
        if isinstance(camera, str):
            if camera not in self.cameras:
                raise KeyError(f"the rig has no camera {camera!r}, but {', '.join(map(repr, self.cameras))}")
            return self.cameras.index(camera)
        try:
            index = operator.index(camera)
        except TypeError:
            raise TypeError(f"a camera is its index or its name, not {camera!r}") from None
        if not 0 <= index < len(self._cameras):
            raise IndexError(f"the rig has no camera {index}, but {len(self._cameras)} from 0")
        return index


_CROSS_STEP = 0.01
"""Tangent between the middle and the arms of the cross from which a pinhole's scale is taken."""
_CROSS = np.array([[0, 0, 1], [-_CROSS_STEP, 0, 1], [_CROSS_STEP, 0, 1], [0, -_CROSS_STEP, 1], [0, _CROSS_STEP, 1]])


def _camera(name, sensor, region, rotation, translation_mm, is_central) -> Camera:
    rig_from_camera = np.eye(4)
    rig_from_camera[:3, :3] = np.reshape(rotation, (3, 3))
    rig_from_camera[:3, 3] = translation_mm
    rig_from_camera.flags.writeable = False
    width, height = sensor
    return Camera(name, width, height, tuple(region), is_central, rig_from_camera)


def _square(name: str, given: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(given)
    if array.dtype.kind not in "fiu" or array.shape != (3, 3) or not np.isfinite(array).all():
        raise ValueError(f"{name} must be 3 x 3 finite numbers")
    return array.astype(np.float64)


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.array_equal(matrix[2], [0.0, 0.0, 1.0]):
        raise ValueError(f"the last row of matrix is {matrix[2]}; of a pinhole's it is 0, 0, 1")
    try:
        return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise ValueError("matrix has no inverse: its focal lengths must not be 0") from None
