"""The part of a recording that teaches, and settings with a few of them changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.detector import Config, parse_config
from belie.evaluation.run import Checked
from belie.types import MountedCamera, RecordingError, Step

LEAST_FRAMES = 60
_LEARNT_SHARE = 2.0 / 3.0
SettingPath = tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TeachingPart:
    """The first two thirds of a recording, with the surface that `run_detector` asks for.

    Parameters
    ----------
    recording : Recording
        The whole.
    until_ns : int
        Stamp of the first frame that does not teach.
    learnt_s, held_out_s : float
        Seconds that teach, and that do not.
    """

    recording: Checked
    until_ns: int
    learnt_s: float
    held_out_s: float

    @classmethod
    def of(cls, recording: Checked) -> TeachingPart:
        """Split a recording; raises `RecordingError` if it is too short."""
        stamps_ns = recording.frame_stamps_ns()
        if len(stamps_ns) < LEAST_FRAMES:
            raise RecordingError(
                f"{recording.path} has {len(stamps_ns)} frames, too few to learn from: "
                f"at least {LEAST_FRAMES} are needed"
            )
        until_ns = int(stamps_ns[int(len(stamps_ns) * _LEARNT_SHARE)])
        return cls(
            recording=recording,
            until_ns=until_ns,
            learnt_s=(until_ns - int(stamps_ns[0])) * 1e-9,
            held_out_s=(int(stamps_ns[-1]) - until_ns) * 1e-9,
        )

    def __getattr__(self, name: str) -> Any:
        return getattr(self.recording, name)

    @property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The cameras by name."""
        return self.recording.cameras

    @property
    def path(self) -> Path:
        """Where the whole recording is."""
        return self.recording.path

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of the frames that teach, shape (N,)."""
        stamps_ns = self.recording.frame_stamps_ns()
        return stamps_ns[stamps_ns < self.until_ns]

    def steps(self) -> Iterator[Step]:
        """The frames that teach, with their claims."""
        steps = self.recording.steps()
        try:
            yield from takewhile(lambda step: step.frame.stamp_ns < self.until_ns, steps)
        finally:
            getattr(steps, "close", lambda: None)()


def changed(config: Config, changes: Mapping[SettingPath, object]) -> Config:
    """The settings with some of them changed, checked as if they came from a file.

    >>> changed(Config(), {("imu", "rotation_noise_deg"): 0.5}).imu.rotation_noise_deg
    0.5
    """
    values = config.model_dump()
    for path, value in changes.items():
        group = values
        for name in path[:-1]:
            group = group[name]
        group[path[-1]] = value
    return parse_config(values, "calibration")
