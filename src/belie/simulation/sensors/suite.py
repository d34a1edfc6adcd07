"""All sensors on board but the camera, and the box from which their claims are handed out frame by frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from belie.simulation.sensors.gnss import gnss
from belie.simulation.sensors.imu import Imu
from belie.simulation.sensors.localisation import localisation
from belie.simulation.sensors.sampling import Motion
from belie.simulation.sensors.wheel_odometry import WheelOdometry
from belie.types import Claim

if TYPE_CHECKING:
    from belie.simulation.scenario import SensorSettings


class SensorSuite:
    """Motion sensors of one robot, sampled together.

    Examples
    --------
    >>> import numpy as np
    >>> from belie.geometry import SE3
    >>> from belie.simulation.scenario import SensorSettings
    >>> class Standing:
    ...     def T_world_body(self, t_s): return SE3.identity()
    ...     def twist(self, t_s): return np.zeros(3), np.zeros(3)
    >>> suite = SensorSuite(SensorSettings(), start_ns=0, seed=1)
    >>> sorted({claim.source for claim in suite.claims_until(Standing(), 0.1)})
    ['/gnss/fix', '/imu/data', '/odom']
    """

    def __init__(self, settings: SensorSettings, *, start_ns: int, seed: int) -> None:
        self._sensors = (
            Imu(settings.imu, start_ns=start_ns, seed=seed),
            WheelOdometry(settings.wheel_odometry, start_ns=start_ns, seed=seed),
            gnss(settings.gnss, start_ns=start_ns, seed=seed),
            localisation(settings.localisation, start_ns=start_ns, seed=seed),
        )
        rates = (settings.imu, settings.wheel_odometry, settings.gnss, settings.localisation)
        on = [sensor.rate_hz for sensor in rates if sensor.rate_hz > 0.0]
        self.longest_period_s = 1.0 / min(on) if on else 0.0

    def claims_until(self, motion: Motion, stop_s: float) -> list[Claim]:
        """Everything measured up to `stop_s` that was not handed out before."""
        return [claim for sensor in self._sensors for claim in sensor.claims_until(motion, stop_s)]


class Outbox:
    """Claims that wait for their frame; see `belie.types.Step` for what a frame takes along.

    Examples
    --------
    >>> import numpy as np
    >>> from belie.types import MotionClaim
    >>> def imu(t): return MotionClaim(source="/imu", kind="imu", stamp_ns=t, received_ns=t,
    ...                                angular_rad_s=np.zeros(3))
    >>> box = Outbox()
    >>> box.add([imu(0), imu(7), imu(14), imu(21)])
    >>> [[claim.stamp_ns for claim in box.take(frame_ns)] for frame_ns in (0, 10, 20)]
    [[0], [7, 14], [21]]
    """

    def __init__(self) -> None:
        self._waiting: dict[str, list[Claim]] = {}
        self._handed_ns: dict[str, int] = {}

    def add(self, claims: Iterable[Claim]) -> None:
        """Put in claims, each source's in the order of its stamps."""
        for claim in claims:
            self._waiting.setdefault(claim.source, []).append(claim)

    def take(self, frame_ns: int) -> tuple[Claim, ...]:
        """Claims up to the frame, and of each source the first after it where none lies at its very stamp."""
        taken: list[Claim] = []
        for source, waiting in self._waiting.items():
            count = sum(claim.stamp_ns <= frame_ns for claim in waiting)
            last_ns = waiting[count - 1].stamp_ns if count else self._handed_ns.get(source)
            if count < len(waiting) and (last_ns is None or last_ns < frame_ns):
                last_ns = waiting[count].stamp_ns
                count += sum(claim.stamp_ns == last_ns for claim in waiting[count:])
            if last_ns is not None:
                self._handed_ns[source] = last_ns
            taken += waiting[:count]
            del waiting[:count]
        return tuple(sorted(taken, key=lambda claim: claim.stamp_ns))
