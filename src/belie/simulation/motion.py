"""How bodies move: smooth paths driven with a speed profile, bodies that stand, walkers, and a car's unrest.

Every motion is twice continuously differentiable in time, so that an IMU can be derived from it. All of them may be
asked for any time, before the start and after the end too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from belie.geometry import SE3, FloatArray, so3_exp

_H_S = 1e-3  # half the step of the numerical derivative: errors of 1e-6 m/s and rad/s at the shakes of a car


class Motion(Protocol):
    """How a body moves; the axes of the body are x forward, y left, z up."""

    def T_world_body(self, t_s: float) -> SE3:
        """Where the body is, seconds from the start."""
        ...

    def twist(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Linear (m/s) and angular (rad/s) velocity in body axes, shapes (3,)."""
        ...

    def travelled_m(self, t_s: float) -> float:
        """Way covered since the start: turns wheels and swings legs."""
        ...


def twist_of(T_world_body: Callable[[float], SE3], t_s: float) -> tuple[FloatArray, FloatArray]:
    """Body twist of a pose that is given over time, by central differences.

    >>> linear, angular = twist_of(lambda t: SE3.exp([t, 0.0, 0.0, 0.0, 0.0, 0.5 * t]), 1.0)
    >>> linear.round(6), angular.round(6)
    (array([1., 0., 0.]), array([0. , 0. , 0.5]))
    """
    step = (T_world_body(t_s - _H_S).inverse() @ T_world_body(t_s + _H_S)).log() / (2.0 * _H_S)
    return step[:3], step[3:]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Parked:
    """A body that stands.

    >>> Parked(T=SE3.identity()).twist(3.0)[0]
    array([0., 0., 0.])
    """

    T: SE3

    def T_world_body(self, t_s: float) -> SE3:
        """Always the same."""
        return self.T

    def twist(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Zero."""
        return np.zeros(3), np.zeros(3)

    def travelled_m(self, t_s: float) -> float:
        """Zero."""
        return 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """A change of speed.

    Parameters
    ----------
    start_s, duration_s : float
        When it begins and how long it takes.
    change_m_s : float
        By how much the speed grows.
    """

    start_s: float
    duration_s: float
    change_m_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedProfile:
    """A speed with smooth ramps (``10u³ - 15u⁴ + 6u⁵``: no jerk at either end) and the way that follows from it.

    Examples
    --------
    >>> profile = SpeedProfile(start_m_s=10.0, ramps=(Ramp(start_s=1.0, duration_s=4.0, change_m_s=-10.0),))
    >>> profile.speed_m_s(0.0), profile.speed_m_s(3.0), profile.speed_m_s(9.0)
    (10.0, 5.0, 0.0)
    >>> profile.travelled_m(1.0), round(profile.travelled_m(9.0), 6)
    (10.0, 30.0)
    """

    start_m_s: float
    ramps: tuple[Ramp, ...] = ()

    def speed_m_s(self, t_s: float) -> float:
        """Speed at a time."""
        speed = self.start_m_s
        for ramp in self.ramps:
            u = min(max((t_s - ramp.start_s) / ramp.duration_s, 0.0), 1.0)
            speed += ramp.change_m_s * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        return speed

    def travelled_m(self, t_s: float) -> float:
        """Way since time 0: the integral of the speed, in closed form."""
        way = self.start_m_s * t_s
        for ramp in self.ramps:
            u = min(max((t_s - ramp.start_s) / ramp.duration_s, 0.0), 1.0)
            during = u**4 * (2.5 - 3.0 * u + u * u) * ramp.duration_s
            after = max(t_s - ramp.start_s - ramp.duration_s, 0.0)
            way += ramp.change_m_s * (during + after)
        return way


class Path:
    """A smooth curve through points, by arc length (splines of fifth order: four times differentiable).

    Parameters
    ----------
    points : array (N, 3)
        Metres, world, in the order of travel, N >= 6, no two the same. Beyond the ends the path goes straight on.

    Examples
    --------
    >>> path = Path(np.column_stack([np.linspace(0.0, 50.0, 11), np.zeros(11), np.zeros(11)]))
    >>> round(path.length_m, 6), path.at(60.0).round(6), path.direction(20.0).round(6)
    (50.0, array([60.,  0.,  0.]), array([1., 0., 0.]))
    """

    def __init__(self, points: npt.ArrayLike) -> None:
        raw = np.asarray(points, dtype=np.float64)
        if raw.ndim != 2 or raw.shape[1] != 3 or len(raw) < 6:
            raise ValueError(f"a path needs at least six points, shape (N, 3), got {raw.shape}")
        # Arc length twice: of the polygon, then of the spline through it.
        chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(raw, axis=0), axis=1))])
        first = make_interp_spline(chord, raw, k=5)
        fine = np.linspace(0.0, chord[-1], 16 * len(raw))
        curve = first(fine)
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
        knots = np.linspace(0.0, length[-1], 4 * len(raw))
        self.length_m = float(length[-1])
        self._curve = make_interp_spline(knots, first(np.interp(knots, length, fine)), k=5)
        self._slope = self._curve.derivative()

    def at(self, way_m: float) -> FloatArray:
        """Point after a way, shape (3,)."""
        inside = min(max(way_m, 0.0), self.length_m)
        point = np.asarray(self._curve(inside), dtype=np.float64)
        return point + (way_m - inside) * self.direction(inside) if way_m != inside else point

    def direction(self, way_m: float) -> FloatArray:
        """Unit vector of travel, shape (3,)."""
        slope = np.asarray(self._slope(min(max(way_m, 0.0), self.length_m)), dtype=np.float64)
        return slope / float(np.linalg.norm(slope))

    def frame(self, way_m: float) -> SE3:
        """Position and heading, level: x forward along the path, z up."""
        x, y, _ = self.direction(way_m)
        across = math.hypot(x, y)
        x, y = x / across, y / across
        return SE3(np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]]), self.at(way_m))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """A body driven along a path.

    Parameters
    ----------
    path : Path
        Where.
    speed : SpeedProfile
        How fast.
    start_m : float
        Way along the path at time 0.
    shift : callable, optional
        Maps the time to a shift to the left, metres, for a change of lanes; smooth.

    Examples
    --------
    >>> path = Path(np.column_stack([np.linspace(0.0, 50.0, 11), np.zeros(11), np.zeros(11)]))
    >>> drive = Drive(path=path, speed=SpeedProfile(start_m_s=10.0))
    >>> drive.T_world_body(2.0).t.round(6), drive.twist(2.0)[0].round(6)
    (array([20.,  0.,  0.]), array([10.,  0.,  0.]))
    """

    path: Path
    speed: SpeedProfile
    start_m: float = 0.0
    shift: Callable[[float], float] | None = None

    def T_world_body(self, t_s: float) -> SE3:
        """Where the body is; it looks where it goes."""
        way = self.start_m + self.speed.travelled_m(t_s)
        T = self.path.frame(way)
        if self.shift is None:
            return T
        # The heading leans by the slope of the shift over the way.
        slope = (self.shift(t_s + _H_S) - self.shift(t_s - _H_S)) / (2.0 * _H_S)
        yaw = math.atan2(slope, max(self.speed.speed_m_s(t_s), 0.5))
        sideways = SE3.from_translation([0.0, self.shift(t_s), 0.0])
        return T @ sideways @ SE3(so3_exp(np.array([0.0, 0.0, yaw])), np.zeros(3))

    def twist(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Linear and angular velocity in body axes."""
        return twist_of(self.T_world_body, t_s)

    def travelled_m(self, t_s: float) -> float:
        """Way since the start."""
        return self.speed.travelled_m(t_s)


class Unrest:
    """A motion with the small heave, roll and pitch of a body on springs (or in the wind): sums of sinusoids.

    Parameters
    ----------
    base : Motion
        What is disturbed.
    seed : int
        Of frequencies and phases.
    heave_m, roll_rad, pitch_rad, yaw_rad : float
        Standard deviations at speed; nothing moves at standstill unless `at_rest`.
    slowest_hz, fastest_hz : float
        Band of the frequencies.
    at_rest : bool
        Whether the unrest goes on at standstill, as that of a drone.

    Examples
    --------
    >>> calm = Parked(T=SE3.identity())
    >>> Unrest(calm, seed=1).T_world_body(2.0).is_close(SE3.identity())
    True
    >>> Unrest(calm, seed=1, at_rest=True).T_world_body(2.0).is_close(SE3.identity())
    False
    """

    def __init__(
        self,
        base: Motion,
        *,
        seed: int,
        heave_m: float = 0.012,
        roll_rad: float = 0.0035,
        pitch_rad: float = 0.004,
        yaw_rad: float = 0.0008,
        slowest_hz: float = 0.5,
        fastest_hz: float = 2.2,
        at_rest: bool = False,
    ) -> None:
        rng = np.random.default_rng([seed, 7])
        count = 5
        self._base, self._at_rest = base, at_rest
        self._rate = 2.0 * np.pi * np.exp(rng.uniform(math.log(slowest_hz), math.log(fastest_hz), (4, count)))
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (4, count))
        deviation = np.array([heave_m, roll_rad, pitch_rad, yaw_rad])
        self._amplitude = (deviation * math.sqrt(2.0 / count))[:, None] * np.ones(count)

    def T_world_body(self, t_s: float) -> SE3:
        """The disturbed pose."""
        z, roll, pitch, yaw = (self._amplitude * np.sin(self._rate * t_s + self._phase)).sum(axis=1)
        share = 1.0
        if not self._at_rest:
            speed = float(np.linalg.norm(self._base.twist(t_s)[0]))
            share = speed**3 / (speed**3 + 8.0)  # cubed: smooth through standstill
        disturbance = SE3(so3_exp(share * np.array([roll, pitch, yaw])), np.array([0.0, 0.0, share * z]))
        return self._base.T_world_body(t_s) @ disturbance

    def twist(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Linear and angular velocity in body axes."""
        return twist_of(self.T_world_body, t_s)

    def travelled_m(self, t_s: float) -> float:
        """Way of the undisturbed motion."""
        return self._base.travelled_m(t_s)


def walk(points: Sequence[Sequence[float]], *, speed_m_s: float, start_m: float = 0.0) -> Drive:
    """A walker along way points (x, y) or (x, y, z), at an even pace and through rounded corners.

    >>> walk([(0.0, 0.0), (10.0, 0.0)], speed_m_s=1.4).T_world_body(5.0).t.round(3)
    array([7., 0., 0.])
    """
    corners = np.zeros((len(points), 3))
    for i, point in enumerate(points):
        corners[i, : len(point)] = point
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    ways = np.linspace(0.0, lengths[-1], max(6, round(lengths[-1] / 1.5) + 1))
    dense = np.column_stack([np.interp(ways, lengths, corners[:, axis]) for axis in range(3)])
    return Drive(path=Path(dense), speed=SpeedProfile(start_m_s=speed_m_s), start_m=start_m)
