"""Runs the program."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from typing import Any, Dict, Optional, Union

from ._errors import CalibrationError, ProgramNotFound, Undetermined, UsageError

Argument = Union[str, "os.PathLike[str]", int, float]

VARIABLE = "CALIB_OFFLINE"
"""The environment variable that names the program."""


def find_program(program: Optional[Union[str, "os.PathLike[str]"]] = None) -> str:
    """The program's path: ``program`` if given, else that of ``CALIB_OFFLINE``, else ``calib-offline`` on ``PATH``.

    Raises:
        ProgramNotFound: nothing that can be run stands there.
    """
    if program is not None:
        asked, where = os.fspath(program), "the argument program"
    elif os.environ.get(VARIABLE):
        asked, where = os.environ[VARIABLE], f"the environment variable {VARIABLE}"
    else:
        asked, where = "calib-offline", "PATH"
    found = shutil.which(asked)
    if found is None:
        raise ProgramNotFound(
            f"{asked} cannot be run (from {where})\n"
            f"try: install it with cargo install --path calib-offline, or name it with program= or {VARIABLE}"
        )
    return found


def run(
    *arguments: Argument,
    program: Optional[Union[str, "os.PathLike[str]"]] = None,
    verbose: bool = False,
    timeout_s: Optional[float] = None,
) -> Dict[str, Any]:
    """Runs a command with ``--json`` and returns the object that it prints; its help says what is in it.

    Args:
        arguments: as on the command line: ``run("inspect", "rig.rays")``.
        program: see :func:`find_program`.
        verbose: whether its narration and progress may go to standard error.
        timeout_s: end it after so many seconds.

    Returns:
        The object, also where the verdict is "fail" (exit code 1).

    Raises:
        UsageError, Undetermined: the program's error, with its remedy.
        CalibrationError: it ended in another way.
        ProgramNotFound: there is no program.
        subprocess.TimeoutExpired: it took longer.
    """
    command = [find_program(program), "--json", *map(_text, arguments)]
    ended = subprocess.run(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=None if verbose else subprocess.PIPE,
        timeout=timeout_s,
        check=False,
    )
    try:
        found = json.loads(ended.stdout)
    except ValueError:
        found = None
    if ended.returncode in (0, 1) and isinstance(found, dict):
        return found
    if isinstance(found, dict) and "error" in found:
        kind = {2: UsageError, 3: Undetermined}.get(ended.returncode, CalibrationError)
        raise kind(ended.returncode, list(found["error"]), found.get("remedy"), list(found.get("causes") or []))
    said = (ended.stderr or b"").decode(errors="replace").strip()
    raise CalibrationError(
        ended.returncode, [f"{command[0]} ended with code {ended.returncode} and no answer", *said.splitlines()], None, []
    )


def _text(argument: Argument) -> str:
    return os.fspath(argument) if isinstance(argument, (str, os.PathLike)) else str(argument)
