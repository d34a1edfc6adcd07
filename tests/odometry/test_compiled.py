"""Same input, same answer: whether a process compiled the kernels or found them in numba's cache."""

import os
import subprocess
import sys

import pytest

FOLLOWED = """
import hashlib
import cv2
import numpy as np
from belie.odometry.local_matching import match_corners
from belie.types import read_only

image = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (160, 160), np.uint8), (0, 0), 1.5)
def pictures(whole):
    halves = [read_only(whole), read_only(cv2.pyrDown(whole)), read_only(cv2.pyrDown(cv2.pyrDown(whole)))]
    return tuple(halves)
moved = cv2.warpAffine(image, np.float32([[1.01, 0.01, 2.3], [-0.01, 1.01, 1.7]]), (160, 160))
start = np.random.default_rng(1).uniform(40, 120, (60, 2))
found = match_corners(pictures(image), pictures(moved), start, np.ones(60, bool), 12, 0.75, 4.0)
print(hashlib.sha256(found[0].tobytes()).hexdigest(), int(found[2]))
"""


@pytest.mark.slow  # compiles what local matching needs: seconds
def test_a_process_that_compiles_follows_corners_as_one_that_loads(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    cold, warm = (
        subprocess.run(
            [sys.executable, "-c", FOLLOWED], env=environment, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    )
    assert any(tmp_path.rglob("*.nbc"))
    assert int(cold.split()[1]) > 20
    assert cold == warm
