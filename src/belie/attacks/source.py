"""What an attack asks of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from belie.types import MountedCamera, Step

BodyAxes = Literal["flu", "rdf"]


class Source(Protocol):
    """A recording, as far as attacks use it; `belie.recordings.Recording` is one.

    ``body_axes`` says how the body frame lies in the vehicle: ``flu`` is x forward, y left, z up (ROS);
    ``rdf`` is x right, y down, z forward (a camera's axes, as in KITTI).
    """

    @property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The cameras by name."""
        ...

    @property
    def body_axes(self) -> BodyAxes:
        """How the body frame lies in the vehicle."""
        ...

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of all frames, in order, shape (N,)."""
        ...

    def steps(self) -> Iterator[Step]:
        """Frames with their claims, from the first one, as often as it is called."""
        ...
