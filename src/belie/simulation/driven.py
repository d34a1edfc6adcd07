"""A scenario whose vehicle is steered while it is recorded, and what it runs into.

Claims travel with the frame that they are stamped up to; their delays are in ``received_ns`` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray
from belie.simulation.sensors.suite import SensorSuite
from belie.simulation.simulate import Replay, SimulatedRecording
from belie.simulation.stage import START_NS, View
from belie.simulation.vehicle import Vehicle, VehicleSettings, overlap, rectangle
from belie.types import Claim, MountedCamera, Step

_CHECK_S = 0.05  # between two looks for a collision: at 25 m/s that is 1.25 m, a third of a car
_CLEARANCE_M = 2.0  # what hangs higher is driven under


class DrivenRecording:
    """A scenario whose vehicle is steered while it is read: set `command` after every step.

    It has the surface that attacks and the writer ask of a recording.
    """

    body_axes: Literal["flu"] = "flu"

    def __init__(
        self,
        simulated: SimulatedRecording,
        *,
        settings: VehicleSettings,
        on_view: Callable[[View], None] | None,
    ) -> None:
        self._simulated, self._on_view = simulated, on_view
        self.scenario, self.world = simulated.scenario, simulated.world
        linear, _ = self.world.ego.twist(0.0)
        self.vehicle = Vehicle(
            settings,
            self.world.ego.T_world_body(0.0),
            speed_m_s=float(np.linalg.norm(linear)),
            height_m=self.world.ground_height_m,
        )
        self.command = (0.0, 0.0)
        self.collision: tuple[float, str] | None = None
        self.most_off_lane_m = 0.0
        self._claims: list[tuple[Claim, ...]] = []

    @property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The one camera."""
        return self._simulated.cameras

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Header stamps of all frames, shape (N,), if it comes so far."""
        return self._simulated.frame_stamps_ns()

    def steps(self) -> Iterator[Step]:
        """The frames as they are driven; ends at a collision."""
        scenario = self.scenario
        suite = SensorSuite(scenario.sensors, start_ns=START_NS, seed=scenario.seed)
        with self._simulated.open_stage() as stage:
            for index in range(scenario.frame_count):
                t_s = index / scenario.frame_rate_hz
                self._drive_to(t_s)
                if self.collision is not None:
                    return
                view = stage.look(index, self.vehicle)
                claims = suite.claims_until(self.vehicle, t_s)
                if view.detections is not None:
                    claims.append(view.detections)
                if self._on_view is not None:
                    self._on_view(view)
                claims.sort(key=lambda claim: claim.stamp_ns)
                self._claims.append(tuple(claims))
                yield Step(frame=view.frame, claims=tuple(claims))

    def replayed(self) -> Replay:
        """The honest claims of the drive before black frames: all that attack labels need."""
        return Replay.of(self, self._claims)

    def _drive_to(self, stop_s: float) -> None:
        steer_rad, acceleration = self.command
        while self.collision is None and self.vehicle.now_s < stop_s - 1e-9:
            until_s = min(stop_s, self.vehicle.now_s + _CHECK_S)
            self.vehicle.drive(until_s, steer_rad=steer_rad, acceleration_m_s2=acceleration)
            self._look_for_collision(until_s)

    def _look_for_collision(self, t_s: float) -> None:
        outline, lane = self.vehicle.footprint(t_s), self.world.lane
        off_m = off_lane_m(lane.centre_m, outline.mean(axis=0))
        self.most_off_lane_m = max(self.most_off_lane_m, off_m)
        if off_m > lane.half_width_m:  # half of the vehicle is beyond the marks
            self.collision = (t_s, "left its lane")
        for actor in self.world.actors:
            has_post = any(part.is_mount for part in actor.parts)
            if actor.base_m > _CLEARANCE_M and not has_post:
                continue
            T = actor.motion.T_world_body(t_s)
            length_m, width_m, _ = actor.dimensions_m
            if overlap(outline, rectangle(T.t[:2], T.R[:2, 0], length_m, width_m)):
                self.collision = (t_s, f"hit {actor.label} {actor.id}")


def off_lane_m(centre_m: FloatArray, point: FloatArray) -> float:
    """Distance of a point on the ground from a line, shape (N, 2 or 3), metres.

    >>> line = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    >>> off_lane_m(line, np.array([5.0, -2.0]))
    2.0
    """
    starts, ends = centre_m[:-1, :2], centre_m[1:, :2]
    along = ends - starts
    share = np.einsum("ij,ij->i", point - starts, along) / np.einsum("ij,ij->i", along, along)
    feet = starts + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(feet - point, axis=1).min())
