"""A scenario as a recording: rendered and sampled while it is read, the same bytes at every reading."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3
from belie.simulation.sensors.sampling import NS_PER_S
from belie.simulation.sensors.suite import Outbox, SensorSuite
from belie.simulation.stage import CAMERA, START_NS, Stage, View, build_world, open_stage
from belie.types import Claim, Frame, MountedCamera, Step

if TYPE_CHECKING:
    from belie.simulation.scenario import Scenario
    from belie.simulation.sensors import GnssSettings
    from belie.simulation.world import World

StageOpener = Callable[["Scenario", "World"], AbstractContextManager[Stage]]


class SimulatedRecording:
    """A scenario, with the surface of `belie.recordings.Recording`; nothing is rendered before `steps` is read.

    Parameters
    ----------
    scenario : Scenario
        What to simulate.
    on_view : callable, optional
        Is given every `View` as it is rendered: for previews and labels.
    world : World, optional
        By default built from the scenario.
    stage_opener : callable, optional
        Sets up the world before a camera; by default `belie.simulation.stage.open_stage`.
    """

    format = "simulated"
    body_axes: Literal["flu"] = "flu"
    join_counts = None
    streams: tuple[()] = ()

    def __init__(
        self,
        scenario: Scenario,
        *,
        on_view: Callable[[View], None] | None = None,
        world: World | None = None,
        stage_opener: StageOpener | None = None,
    ) -> None:
        self.scenario = scenario
        self.path = Path(f"{scenario.scene}-{scenario.manoeuvre}-{scenario.weather}")
        self.world = build_world(scenario) if world is None else world
        self._on_view, self._open = on_view, stage_opener or open_stage
        self._claims: list[tuple[Claim, ...]] = []

    @cached_property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The one camera."""
        mounted = MountedCamera(model=self.scenario.camera_model(), T_body_cam=self.world.T_body_cam)
        return {CAMERA: mounted}

    @property
    def geodetic_origin(self) -> GnssSettings | None:
        """Where GNSS claims have their ENU origin (latitude, longitude, altitude); None without GNSS."""
        gnss = self.scenario.sensors.gnss
        return gnss if gnss.rate_hz > 0.0 else None

    def open_stage(self) -> AbstractContextManager[Stage]:
        """Set up the world before the camera."""
        return self._open(self.scenario, self.world)

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Header stamps of all frames, shape (N,)."""
        times_s = np.arange(self.scenario.frame_count) / self.scenario.frame_rate_hz
        return START_NS + np.round(times_s * NS_PER_S).astype(np.int64)

    def true_poses(self) -> list[tuple[int, SE3]]:
        """Stamp (ns) and ``T_world_body`` of every frame."""
        rate_hz = self.scenario.frame_rate_hz
        return [
            (int(stamp_ns), self.world.ego.T_world_body(index / rate_hz))
            for index, stamp_ns in enumerate(self.frame_stamps_ns())
        ]

    def steps(self) -> Iterator[Step]:
        """The frames with their claims, rendered one by one.

        Raises
        ------
        MissingExtraError
            Without ``moderngl``.
        """
        scenario, kept = self.scenario, list[tuple[Claim, ...]]()
        suite, box = SensorSuite(scenario.sensors, start_ns=START_NS, seed=scenario.seed), Outbox()
        last_s = (scenario.frame_count - 1) / scenario.frame_rate_hz
        with self.open_stage() as stage:
            for index in range(scenario.frame_count):
                view = stage.look(index)
                # As far ahead as the slowest sensor needs to say something after the frame, but not past the end.
                box.add(suite.claims_until(self.world.ego, min(view.t_s + suite.longest_period_s, last_s)))
                if view.detections is not None:
                    box.add([view.detections])
                if self._on_view is not None:
                    self._on_view(view)
                claims = box.take(view.frame.stamp_ns)
                kept.append(claims)
                yield Step(frame=view.frame, claims=claims)
        self._claims = kept

    def replayed(self) -> Replay:
        """The claims of the last complete reading before black frames: all that attack labels need, at once.

        Raises
        ------
        ValueError
            If `steps` was not read to its end.
        """
        return Replay.of(self, self._claims)


class Driven(Protocol):
    """What a replay asks of a drive."""

    @property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The cameras by name."""
        ...

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Header stamps of all frames, shape (N,)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replay:
    """Claims that were simulated, before black frames."""

    cameras: Mapping[str, MountedCamera]
    stamps_ns: tuple[int, ...]
    claims: tuple[tuple[Claim, ...], ...]
    body_axes: Literal["flu"] = "flu"

    @classmethod
    def of(cls, drive: Driven, claims: Sequence[tuple[Claim, ...]]) -> Replay:
        """The claims of a drive's frames, as they were read.

        Raises
        ------
        ValueError
            If nothing was read.
        """
        if not claims:
            raise ValueError("read the steps to their end first")
        return cls(
            cameras=drive.cameras, stamps_ns=tuple(drive.frame_stamps_ns().tolist()), claims=tuple(claims)
        )

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Header stamps of all frames, shape (N,)."""
        return np.array(self.stamps_ns, dtype=np.int64)

    def steps(self) -> Iterator[Step]:
        """The claims, frame by frame."""
        ((name, mounted),) = self.cameras.items()
        black = np.zeros((mounted.model.height, mounted.model.width), np.uint8)
        for stamp_ns, claims in zip(self.stamps_ns, self.claims, strict=False):  # a drive may end early
            yield Step(
                frame=Frame(camera=name, stamp_ns=stamp_ns, received_ns=stamp_ns, image=black), claims=claims
            )
