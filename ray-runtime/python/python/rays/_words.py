"""Why bytes are no blob, in the words of ``calib-offline``."""

from __future__ import annotations


class BlobError(ValueError):
    """Bytes that are no blob which this version reads.

    Attributes:
        code: the stable code of the runtime, as in ``rays.h`` (1: truncated, 2: no blob, 3: wrong version, ...).
        remedy: what to do about it.
    """

    def __init__(self, message: str, code: int, remedy: str) -> None:
        super().__init__(f"{message}\ntry: {remedy}")
        self.code = code
        self.remedy = remedy


_REMEDIES = {
    1: "the file is cut off: copy it again, binary",
    2: "this is no .rays file: write one with calib-offline pack",
    3: "pack the calibration again with this version, or read it with the one that wrote it",
    4: "the file was damaged on the way: copy it again, binary",
    5: "the file was damaged on the way: copy it again, binary",
}


def refused(name: str, content: bytes, code: int, words: str) -> BlobError:
    """The error for a blob that the runtime refused with a code and words."""
    remedy = _REMEDIES.get(code, "pack the calibration again")
    if content.lstrip()[:1] == b"{":
        remedy = "a calibration.json is opened as the rig.rays beside it, or as what calib-offline pack makes of it"
    return BlobError(f"{name}: the runtime refuses it: {words}", code, remedy)
