"""Why a pixel or a match has no answer."""

from enum import IntEnum


class Status(IntEnum):
    """What ``POINTS.csv`` of ``calib-offline measure`` says in words; ``Status(1).word`` is ``"outside"``."""

    OK = 0
    """There is an answer."""
    OUTSIDE = 1
    """A pixel outside of its camera's calibrated area, or not a number."""
    PARALLEL = 2
    """The rays are parallel within 0.0002 rad."""
    BEHIND = 3
    """The rays meet behind a camera."""

    @property
    def word(self) -> str:
        """The word in the file."""
        return self.name.lower()


OK = Status.OK
OUTSIDE = Status.OUTSIDE
PARALLEL = Status.PARALLEL
BEHIND = Status.BEHIND
