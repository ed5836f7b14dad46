"""Data and programs that several tests need."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import rays

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def golden() -> Path:
    return ROOT / "data/golden"


@pytest.fixture(scope="session")
def program() -> str:
    """The program of this repository, which ``tests/run python`` builds."""
    named = os.environ.get("CALIB_OFFLINE", str(ROOT / "target/release/calib-offline"))
    found = shutil.which(named)
    assert found, f"{named} is missing: cargo build --locked --release -p calib-offline"
    return found


@pytest.fixture(params=["stereo-v2", "stereo-v3-fast", "stereo-v3-small", "stereo-v4-fast", "stereo-v4-small"])
def blob_path(request, golden) -> Path:
    return golden / f"{request.param}.rays"


@pytest.fixture
def rig(golden) -> rays.Rig:
    return rays.open(golden / "stereo-v3-fast.rays")


def pixels(count: int, seed: int = 1) -> np.ndarray:
    """Pixels of a sensor of 64 x 48 and a little around it."""
    generator = np.random.default_rng(seed)
    return generator.uniform([-2.0, -2.0], [65.0, 49.0], (count, 2)).astype(np.float32)
