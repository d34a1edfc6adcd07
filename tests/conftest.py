"""Shared fixtures: where the real recordings are."""

import os
import warnings
from pathlib import Path

import pytest

DATA = Path(os.environ.get("BELIE_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real recordings (`../shared/data` or `BELIE_DATA`); skips, loudly, where missing."""
    if not (DATA / "kitti00").is_dir():
        warnings.warn(f"real recordings not found at {DATA}: tests on real data are SKIPPED", stacklevel=1)
        pytest.skip(f"no recordings at {DATA}; set BELIE_DATA")
    return DATA
