"""Rays, points and their uncertainty from a calibrated camera rig, over NumPy arrays.

    import rays

    rig = rays.open("results/rig.rays")
    points = rig.triangulate(uv_left, uv_right, sigma=True)
    points.xyz[points.ok]           # mm, in the rig's frame

Conventions: the center of the sensor's top-left pixel is (0, 0), u right, v down. Lengths are millimeters, in
the rig's frame. Answers are ``float32`` and have the bits of ``calib-offline measure RIG.rays`` and of the device
for the same ``float32`` pixels; pixels of ``float64`` are rounded to ``float32`` first. Where there is no answer
there are NaN, and a status that says why.

Arrays of ``float32`` or ``float64`` whose rows lie one behind the other are read where they are; all others are copied. Work is
done by the calling thread with the interpreter's lock released, so that other threads run meanwhile. They must
not write to the arrays that are being read.
"""

from __future__ import annotations

import os
from typing import Union

from ._points import Points
from ._rig import Camera, Rig
from ._status import BEHIND, OK, OUTSIDE, PARALLEL, Status
from ._words import BlobError, refused

__all__ = ["BEHIND", "OK", "OUTSIDE", "PARALLEL", "BlobError", "Camera", "Points", "Rig", "Status", "open"]

_open_file = open


def open(path_or_bytes: Union[str, "os.PathLike[str]", bytes, bytearray, memoryview]) -> Rig:
    """Checks a blob (``*.rays``) and opens it.

    Args:
        path_or_bytes: the path of a file, or the bytes themselves (anything with a buffer, such as ``mmap``).

    Raises:
        BlobError: it is no blob, of a version that is not read here, or damaged.
        OSError: the file cannot be read.
        TypeError: neither a path nor bytes.
    """
    if isinstance(path_or_bytes, (str, os.PathLike)):
        with _open_file(path_or_bytes, "rb") as file:
            content = file.read()
        name = os.fspath(path_or_bytes)
    else:
        try:
            content = bytes(memoryview(path_or_bytes).cast("B"))
        except TypeError as error:
            kind = type(path_or_bytes).__name__
            raise TypeError(f"expected the path of a blob or its bytes, found {kind}") from error
        name = "bytes"
    from ._rays import Blob

    try:
        return Rig(Blob(content))
    except ValueError as error:
        code, words = error.args
        raise refused(name, content, code, words) from None
