"""The families of attacks that are measured, and what is asked of each."""

from __future__ import annotations

import math
from dataclasses import dataclass

from _recordings import GNSS, LOCALISATION, RECORDINGS


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Attacks of one kind, and what the issue asks for.

    Parameters
    ----------
    specs : tuple of str
        Without the start, which is filled in; ``{x}`` stands for the magnitude, ``{minus_x}`` and
        ``{inverse_x}`` for what is made of it.
    within : int
        Attacked frames, the first one included.
    target : float or None
        Share of hits asked for; None: told for information.
    magnitude : float
        What ``{x}`` is in the table.
    sweep : tuple of float
        Magnitudes, largest first.
    lasts : int or None
        Attacked frames, where the attack has an end.
    reach_m : float or None
        A drag-off is to be caught before it gets so far, instead of `within`; `magnitude` is in m/s.
    least_m : float
        A position that is set to what it happens to be is no lie: smaller ones are not tried.
    recordings : tuple of str
        Where it can be tried.
    """

    name: str
    specs: tuple[str, ...]
    within: int = 10
    target: float | None = 0.95
    magnitude: float = 0.0
    unit: str = ""
    sweep: tuple[float, ...] = ()
    lasts: int | None = None
    reach_m: float | None = None
    least_m: float = 0.0
    recordings: tuple[str, ...] = RECORDINGS

    @property
    def label(self) -> str:
        """Name and magnitude."""
        return f"{self.name} {self.magnitude:g} {self.unit}" if self.unit else self.name

    def frames_allowed(self, period_s: float, magnitude: float | None = None) -> int:
        """Attacked frames within which an alert is a hit."""
        if self.reach_m is None:
            return self.within
        return math.floor(self.reach_m / (magnitude or self.magnitude) / period_s)

    def texts(self, onset: int, magnitude: float | None = None) -> list[str]:
        """The specifications for one onset."""
        stop = "" if self.lasts is None else f",stop={onset + self.lasts}"
        x = self.magnitude if magnitude is None else magnitude
        values = {"x": f"{x:g}", "minus_x": f"{-x:g}", "inverse_x": f"{1 / x:g}" if x else ""}
        filled = [spec.format(**values) for spec in self.specs]
        return [f"{text}{',' if ':' in text else ':'}start={onset}{stop}" for text in filled]


def _both(spec: str) -> tuple[str, str]:
    """A specification and its mirror image."""
    return spec, spec.replace("{x}", "{minus_x}")


def _jumps(source: str) -> tuple[str, ...]:
    x, y = (_both(f"position-offset:axis={axis},magnitude={{x}},source={source}") for axis in "xy")
    return x + y


_OUTDOORS = ("kitti00", "kitti06")
FAMILIES = (
    Family(
        name="paper-odometry",
        specs=_both("paper-odometry:axis=left,rate={x}") + _both("paper-odometry:axis=up,rate={x}"),
        within=3,
        target=1.0,
        magnitude=0.2,
        unit="m/frame",
        sweep=(0.2, 0.1, 0.05, 0.03, 0.02),
    ),
    Family(
        name="paper-odometry, forward",
        specs=_both("paper-odometry:axis=forward,rate={x}"),
        within=3,
        target=None,
        magnitude=0.2,
        unit="m/frame",
    ),
    Family(
        name="paper-position, localisation",
        specs=tuple(f"paper-position:axis={axis},source={LOCALISATION}" for axis in "xy"),
        within=3,
        target=1.0,
        least_m=0.5,
    ),
    Family(
        name="paper-position, GNSS",
        specs=tuple(f"paper-position:axis={axis},source={GNSS}" for axis in "xy"),
        within=3,
        target=1.0,
        least_m=4.0,
        recordings=_OUTDOORS,
    ),
    Family(
        name="lateral",
        specs=_both("odometry-offset:axis=left,rate={x}"),
        lasts=10,
        magnitude=0.05,
        unit="m/frame",
        sweep=(0.2, 0.1, 0.05, 0.03, 0.02, 0.01),
    ),
    Family(
        name="yaw bias",
        specs=_both("odometry-bias:axis=yaw,rate={x}"),
        magnitude=0.05,
        unit="deg/frame",
        sweep=(0.3, 0.1, 0.05, 0.03, 0.02, 0.01),
    ),
    Family(
        name="gyro bias",
        specs=_both("imu-bias:axis=yaw,rate={x}"),
        magnitude=0.5,
        unit="deg/s",
        sweep=(3.0, 1.0, 0.5, 0.3, 0.2, 0.1),
    ),
    Family(
        name="scale",
        specs=("odometry-scale:factor={x}",),
        magnitude=1.2,
        unit="x",
        sweep=(1.5, 1.2, 1.1, 1.05, 1.03),
    ),
    Family(
        name="scale, divided by",
        specs=("odometry-scale:factor={inverse_x}",),
        target=None,
        magnitude=1.2,
        unit="x",
        sweep=(1.5, 1.2, 1.1, 1.05, 1.03),
    ),
    Family(name="odometry freeze", specs=("odometry-freeze",)),
    Family(name="odometry replay", specs=("odometry-replay:delay=20",)),
    Family(name="position freeze", specs=(f"position-freeze:source={LOCALISATION}",)),
    Family(name="position replay", specs=(f"position-replay:delay=20,source={LOCALISATION}",)),
    Family(
        name="position jump",
        specs=_jumps(LOCALISATION),
        within=1,
        magnitude=2.0,
        unit="m",
        sweep=(5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05),
    ),
    Family(
        name="position jump, GNSS",
        specs=_jumps(GNSS),
        within=1,
        target=None,
        magnitude=2.0,
        unit="m",
        sweep=(10.0, 5.0, 4.0, 3.0, 2.0),
        recordings=_OUTDOORS,
    ),
    Family(
        name="GNSS drag-off before 6 m",
        specs=_both(f"position-ramp:axis=x,rate={{x}},source={GNSS}")
        + _both(f"position-ramp:axis=y,rate={{x}},source={GNSS}"),
        reach_m=6.0,
        magnitude=0.5,
        unit="m/s",
        sweep=(2.0, 1.0, 0.7, 0.5),
        recordings=("kitti00",),
    ),
    Family(name="camera freeze", specs=("camera-freeze",), within=3),
    Family(name="camera replay", specs=("camera-replay:delay=20",), within=3),
)
