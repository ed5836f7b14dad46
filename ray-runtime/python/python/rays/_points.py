"""What comes of matches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np
from numpy.typing import NDArray

from ._status import Status

_WORDS = np.array([status.word for status in Status])


@dataclass(frozen=True, eq=False)
class Points:
    """Triangulated matches. ``...`` stands for the shape of the pixels given, without its last axis."""

    xyz: NDArray[np.float32]
    """Middle of the common perpendicular of both rays, in the rig's frame, mm; shape (..., 3)."""
    gap: NDArray[np.float32]
    """Length of the common perpendicular, mm; shape (...)."""
    status: NDArray[np.uint8]
    """:class:`Status` of each match; shape (...)."""
    sigma: Optional[NDArray[np.float32]] = None
    """Predicted standard deviation along x, y and z, mm; shape (..., 3). None unless asked for."""
    covariance: Optional[NDArray[np.float32]] = None
    """Covariance of the point, mm^2; shape (..., 3, 3). None unless asked for."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which matches have a point; shape (...)."""
        return np.equal(self.status, Status.OK)

    @property
    def words(self) -> NDArray[np.str_]:
        """The status in words, as in ``POINTS.csv``: ok, outside, parallel or behind; shape (...)."""
        return _WORDS[self.status]

    def __len__(self) -> int:
        return len(self.status)
