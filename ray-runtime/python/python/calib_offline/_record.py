"""A calibration and what it is worth."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Union

import rays

from ._program import run

PathLike = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class Record:
    """What ``calibrate`` wrote into a folder."""

    folder: Path
    """The folder."""
    data: Dict[str, Any]
    """All of ``calibration.json``; ``calib-offline/calibration.schema.json`` describes it."""

    @classmethod
    def read(cls, folder: PathLike) -> "Record":
        """The record in a folder of results, or of a ``calibration.json``.

        Raises:
            OSError: it cannot be read.
            ValueError: it is no calibration.
        """
        path = Path(folder)
        path = path / "calibration.json" if path.is_dir() else path
        try:
            data = json.loads(path.read_bytes())
        except ValueError as error:
            raise ValueError(f"{path}: is no calibration: {error}") from None
        if not (isinstance(data, dict) and "verdict" in data):
            raise ValueError(f"{path}: is no calibration: it has no verdict")
        return cls(path.parent, data)

    @property
    def calibration(self) -> Path:
        """``calibration.json``: every number."""
        return self.folder / "calibration.json"

    @property
    def blob(self) -> Path:
        """``rig.rays``: the blob for devices and for :func:`rays.open`."""
        return self.folder / "rig.rays"

    @property
    def report(self) -> Path:
        """``report.html``: the page for people."""
        return self.folder / "report.html"

    @property
    def grade(self) -> str:
        """The verdict: ``"pass"``, ``"doubtful"`` or ``"fail"``."""
        return self.data["verdict"]["grade"]

    @property
    def reasons(self) -> List[str]:
        """What was looked at, a sentence each that begins with its own verdict."""
        return list(self.data["verdict"]["reasons"])

    def rig(self) -> rays.Rig:
        """The rig of the blob."""
        return rays.open(self.blob)


def calibrate(
    folder: PathLike,
    out: PathLike,
    *,
    method: str = "joint",
    exclude: Sequence[int] = (),
    task: Optional[str] = None,
    match_noise_px: Optional[float] = None,
    ray_tables: bool = False,
    force: bool = False,
    program: Optional[PathLike] = None,
    verbose: bool = False,
    timeout_s: Optional[float] = None,
) -> Record:
    """Calibrates from a dataset: writes ``calibration.json``, ``rig.rays`` and ``report.html`` into ``out``.

    Args:
        folder: with ``dataset.toml`` and images or ``corners.csv``.
        out: the folder for the results; made if need be.
        method: ``"joint"`` or ``"alternating"``.
        exclude: poses to leave out, counted from 0, besides those that the manifest leaves out.
        task: predicts the error of a measurement, such as ``"length 100 mm at 800 mm"``.
        match_noise_px: how noisy the pixels of matches will be, px (standard deviation).
        ray_tables: whether to write one ray per pixel too, ``rays_NAME.npy``.
        force: whether to replace results that stand in ``out``.
        program, verbose, timeout_s: as for :func:`calib_offline.run`.

    Returns:
        The record, also where the verdict is "fail": look at ``grade``.

    Raises:
        UsageError: arguments, files or formats.
        Undetermined: the data cannot determine a calibration; ``causes`` says why.
        ProgramNotFound: there is no program ``calib-offline``.
    """
    arguments: List[Any] = ["calibrate", "--output", out, "--method", method]
    if len(exclude):
        arguments += ["--exclude", ",".join(str(int(pose)) for pose in exclude)]
    if task is not None:
        arguments += ["--task", task]
    if match_noise_px is not None:
        arguments += ["--match-noise-px", float(match_noise_px)]
    arguments += ["--ray-tables"] if ray_tables else []
    arguments += ["--force"] if force else []
    # A folder may be named like a flag.
    arguments += ["--", folder]
    run(*arguments, program=program, verbose=verbose, timeout_s=timeout_s)
    return Record.read(out)
