"""Arrays as the runtime reads them: rows of float32 or float64, one behind the other."""

from __future__ import annotations

from typing import Tuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


def rows(name: str, given: ArrayLike, width: int) -> Tuple[NDArray, Tuple[int, ...]]:
    """The rows of an array, not copied if they need not be, and its shape without the last axis.

    Raises:
        TypeError: not numbers, or masked.
        ValueError: the last axis has another length.
    """
    if isinstance(given, np.ma.MaskedArray):
        raise TypeError(f"{name} is a masked array, whose mask would be lost: give {name}.filled(numpy.nan)")
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise ValueError(f"{name} is no array of numbers: {error}") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} is an array of {array.dtype}, not of real numbers")
    if array.ndim == 0 or array.shape[-1] != width:
        axes = ", ".join(("u", "v") if width == 2 else ("x", "y", "z"))
        raise ValueError(f"{name} has the shape {array.shape}; it must end with an axis of {width}: {axes}")
    if array.dtype != np.float32:
        array = array.astype(np.float64, copy=False)
    # Both also bring bytes of another machine's order into this one's.
    array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))
    return array.reshape(-1, width), array.shape[:-1]
