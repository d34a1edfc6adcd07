"""A recording in memory: read or simulated once, attacked and checked as often as one likes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from belie.recordings import JoinCounts, JoinSettings
from belie.recordings.join import DecodedFrame, join
from belie.types import Claim, Frame, MountedCamera, Step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MemoryRecording:
    """A recording whose images are in memory; what `belie.attacks.attack` takes."""

    name: str
    cameras: Mapping[str, MountedCamera]
    joined: tuple[Step, ...]
    body_axes: Literal["flu", "rdf"] = "flu"
    format: str = "memory"
    join_counts: None = None

    @property
    def path(self) -> Path:
        """Its name, as a path: reports are headed by it."""
        return Path(self.name)

    @classmethod
    def of(
        cls, name: str, camera: MountedCamera, frames: Sequence[Frame], claims: Sequence[Claim]
    ) -> MemoryRecording:
        """Join frames and claims as a recording's reader would, each received when it is stamped."""
        arrivals: list[Claim | DecodedFrame] = [
            *claims,
            *(DecodedFrame(frame=f, index=i) for i, f in enumerate(frames)),
        ]
        arrivals.sort(key=lambda a: a.frame.received_ns if isinstance(a, DecodedFrame) else a.received_ns)
        steps = tuple(join(arrivals, settings=JoinSettings(), counts=JoinCounts()))
        return cls(name=name, cameras={frames[0].camera: camera}, joined=steps)

    def until(self, frame: int) -> MemoryRecording:
        """The first frames only."""
        return replace(self, joined=self.joined[:frame])

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of all frames, shape (N,)."""
        return np.array([step.frame.stamp_ns for step in self.joined], dtype=np.int64)

    def steps(self) -> Iterator[Step]:
        """The frames with their claims."""
        return iter(self.joined)
