"""What can go wrong."""

from __future__ import annotations

from typing import Any, Dict, List, Optional


class ProgramNotFound(FileNotFoundError):
    """There is no program ``calib-offline``."""


class CalibrationError(RuntimeError):
    """The program ended without a result. Its text is what the program says, with the remedy.

    Attributes:
        exit_code: 2 for usage, files and formats, 3 where the data cannot determine the answer.
        chain: from what was attempted to the innermost cause.
        remedy: what to do about it, or None.
        causes: what is wrong with the recording, most likely first: objects with ``cause``, ``text`` and others.
    """

    def __init__(self, exit_code: int, chain: List[str], remedy: Optional[str], causes: List[Dict[str, Any]]) -> None:
        lines = ["\n  ".join(chain)]
        if remedy:
            lines.append(f"try: {remedy}")
        super().__init__("\n".join(lines))
        self.exit_code = exit_code
        self.chain = chain
        self.remedy = remedy
        self.causes = causes


class UsageError(CalibrationError):
    """Exit code 2: arguments, files or formats."""


class Undetermined(CalibrationError):
    """Exit code 3: the data cannot determine the answer."""
