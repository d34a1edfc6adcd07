"""What attack-free driving shows of a robot's motion streams: the clock of each against the images', its correlation.

The claimed rotation between two images, read at times shifted by tau, is held against the one that the images show.
Where the robot turns unevenly, the difference r(tau) follows the angular acceleration w, unless tau is the stream's
clock offset: that is where ``sum w r(tau)`` is zero. The acceleration is taken from the neighbouring images (an
instrumental variable; Wooldridge, *Econometric Analysis of Cross Section and Panel Data*, chapter 5): that of claims
is mostly their noise, which says nothing and yet looks as if it did. How well the offset is known follows from the sums
of ``w r`` over blocks of time (batch means): errors of either motion last for a second or more, so that frames are no
independent witnesses.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from belie.detector import Config, Detector
from belie.detector.streams import StreamKey, Streams
from belie.evaluation.calibrate_part import TeachingPart
from belie.geometry import SE3, FloatArray

_STEP_S = 0.01
SHIFTS_S: tuple[float, ...] = tuple(float(x) for x in np.arange(-12, 13) * _STEP_S)
_WAIT_NS = 400_000_000  # until the claims of all shifts are there
_LEAST_FRAMES = 40
_KNOWN_S = 0.02  # standard deviation of an offset that is worth telling
_ASIDE_S = 0.1  # from an image to the neighbours that show its angular acceleration
_SLOPE_STEPS = 3  # to either side of the offset
_OUTLIER = 3.0
_BLOCK_FRAMES, _FEWEST_BLOCKS, _MOST_BLOCKS = 15, 6, 20


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamNote:
    """What was seen of one stream.

    Parameters
    ----------
    check, source : str
        ``odometry``, ``twist`` or ``imu``, and the topic.
    offset_s, sigma_s : float or None
        How much later the stream's stamps are than the images' for the same event, and how well that is known; None
        where the driving does not show it.
    correlation : float
        Lag-one correlation of the rotation residual from image to image.
    frames : int
        That it was seen on.
    """

    check: str
    source: str
    offset_s: float | None
    sigma_s: float | None
    correlation: float
    frames: int

    def in_words(self) -> str:
        """One line.

        >>> note = StreamNote(
        ...     check="imu", source="/imu", offset_s=0.012, sigma_s=0.003, correlation=0.2, frames=90
        ... )
        >>> note.in_words()
        'imu /imu: stamps 12 ms later than the images (+- 3 ms), lag-one correlation 0.20, of 90 frames'
        """
        clock = "clock offset not shown: too little uneven turning"
        if self.offset_s is not None and self.sigma_s is not None:
            side = "later" if self.offset_s >= 0.0 else "earlier"
            clock = f"stamps {abs(self.offset_s) * 1e3:.0f} ms {side} than the images (+- {self.sigma_s * 1e3:.0f} ms)"
        correlation = f"lag-one correlation {self.correlation:.2f}, of {self.frames} frames"
        return f"{self.check} {self.source}: {clock}, {correlation}"


@dataclass(slots=True)
class _Interval:
    start_ns: int
    stop_ns: int
    seen: SE3

    @property
    def seen_rad_s(self) -> FloatArray:
        """Rate of turn that the images show."""
        return SE3(self.seen.R, np.zeros(3)).log()[3:] / ((self.stop_ns - self.start_ns) * 1e-9)


@dataclass(frozen=True, slots=True)
class _Part:
    """One stream in one recording: residuals (N, shifts, 3), rad a second; angular accelerations seen (N, 3)."""

    residuals: FloatArray
    accelerations: FloatArray


def stream_notes(
    parts: Sequence[TeachingPart], config: Config, advance: Callable[[], None]
) -> list[StreamNote]:
    """Every motion stream of the recordings, pooled by its name.

    >>> stream_notes([], Config(), lambda: None)
    []
    """
    found: dict[StreamKey, list[_Part]] = {}
    for part in parts:
        for key, seen in _residuals(part, config, advance).items():
            found.setdefault(key, []).append(seen)
    return [_note(key, several) for key, several in found.items()]


def _residuals(part: TeachingPart, config: Config, advance: Callable[[], None]) -> Mapping[StreamKey, _Part]:
    """Of each stream, the frames in which it has no gap."""
    ((_, camera),) = part.cameras.items()
    detector, streams = Detector(part.cameras, config), Streams(config.streams)
    waiting: deque[_Interval] = deque()
    settled: list[_Interval] = []
    rows: dict[StreamKey, dict[int, FloatArray]] = {}

    def settle(until_ns: int) -> None:
        while waiting and waiting[0].stop_ns <= until_ns:
            interval = waiting.popleft()
            for key, row in _row(interval, streams, camera.T_body_cam).items():
                rows.setdefault(key, {})[len(settled)] = row
            settled.append(interval)

    for step in part.steps():
        detector.update(step.frame, step.claims)
        streams.take(step.claims, step.frame.stamp_ns)
        estimate = detector.estimate
        if estimate is not None and estimate.inliers > 0:
            waiting.append(_Interval(estimate.previous_stamp_ns, estimate.stamp_ns, estimate.T_prev_cur))
        settle(step.frame.stamp_ns - _WAIT_NS)
        advance()
    accelerations = _accelerations(settled)
    found: dict[StreamKey, _Part] = {}
    for key, by_frame in rows.items():
        residuals, seen = np.array(list(by_frame.values())), accelerations[list(by_frame)]
        whole = np.isfinite(residuals).all(axis=(1, 2)) & np.isfinite(seen).all(axis=1)
        found[key] = _Part(residuals[whole], seen[whole])
    return found


def _accelerations(intervals: Sequence[_Interval]) -> FloatArray:
    """Angular acceleration that the images beside each interval show, (N, 3), rad/s²; NaN where some are missing.

    The interval's own rate takes no part, so that its error is not in both factors of ``w r``.
    """
    found = np.full((len(intervals), 3), np.nan)
    if not intervals:
        return found
    rates = np.array([interval.seen_rad_s for interval in intervals])
    stops_s = np.array([interval.stop_ns for interval in intervals]) * 1e-9
    usual_s = float(np.median([interval.stop_ns - interval.start_ns for interval in intervals])) * 1e-9
    aside = max(1, round(_ASIDE_S / usual_s))
    span_s = stops_s[2 * aside :] - stops_s[: -2 * aside]
    near = span_s < 1.5 * 2 * aside * usual_s
    turned = (rates[2 * aside :] - rates[: -2 * aside]) / span_s[:, None]
    found[aside : len(intervals) - aside][near] = turned[near]
    return found


def _row(interval: _Interval, streams: Streams, T_body_cam: SE3) -> dict[StreamKey, FloatArray]:
    interval_s = (interval.stop_ns - interval.start_ns) * 1e-9
    rows: dict[StreamKey, FloatArray] = {}
    for k, shift_s in enumerate(SHIFTS_S):
        shift_ns = round(shift_s * 1e9)
        motions = streams.motions(interval.start_ns + shift_ns, interval.stop_ns + shift_ns, T_body_cam)
        for key, claimed in motions.items():
            row = rows.setdefault(key, np.full((len(SHIFTS_S), 3), np.nan))
            if claimed is not None:
                error = SE3(interval.seen.R.T @ claimed.R, np.zeros(3)).log()[3:]
                row[k] = error / interval_s
    return rows


def _note(key: StreamKey, several: Sequence[_Part]) -> StreamNote:
    check, source = key
    used = [part for part in several if len(part.residuals)]
    # A bias (gyroscope) is no clock offset: it is the same at every shift.
    empty = np.empty((0, len(SHIFTS_S), 3))
    residuals = np.concatenate([empty, *(p.residuals - np.median(p.residuals, axis=0) for p in used)])
    accelerations = np.concatenate([np.empty((0, 3)), *(p.accelerations for p in used)])
    frames, correlation, offset_s, sigma_s = len(residuals), math.nan, None, None
    if frames >= _LEAST_FRAMES:
        correlation = _lag_one(residuals[:, len(SHIFTS_S) // 2])
        offset_s, sigma_s = clock_offset(residuals, accelerations) or (None, None)
    return StreamNote(
        check=check, source=source, offset_s=offset_s, sigma_s=sigma_s, correlation=correlation, frames=frames
    )


def clock_offset(residuals: FloatArray, accelerations: FloatArray) -> tuple[float, float] | None:
    """Clock offset and its standard deviation, seconds; None where the turning does not show it.

    Parameters
    ----------
    residuals : array (N, len(SHIFTS_S), 3)
        Rate of turn, claimed at each shift less seen, without bias, rad/s.
    accelerations : array (N, 3)
        Angular acceleration, rad/s².

    Examples
    --------
    >>> t = 0.1 * np.arange(200)
    >>> rates = [0.3 * np.sin(t + tau - 0.02) - 0.3 * np.sin(t) for tau in SHIFTS_S]
    >>> residuals = np.stack(rates, axis=1)[:, :, None] * np.array([0.0, 1.0, 0.0])
    >>> offset_s, sigma_s = clock_offset(residuals, np.outer(0.3 * np.cos(t), [0.0, 1.0, 0.0]))
    >>> round(offset_s, 3), sigma_s < 0.001
    (0.02, True)
    """
    shifts_s = np.array(SHIFTS_S)
    scale = float(np.median(np.abs(residuals[:, len(shifts_s) // 2]))) * 1.4826
    most = _OUTLIER * max(scale, 1e-3)
    products = (np.clip(residuals, -most, most) * accelerations[:, None]).sum(axis=2)
    sums = products.sum(axis=0)
    rising = np.flatnonzero((sums[:-1] <= 0.0) & (sums[1:] > 0.0))
    if not len(rising):
        return None
    slope, start = np.polyfit(shifts_s, sums, 1)
    k = int(rising[np.argmin(np.abs(shifts_s[rising] + start / slope))])
    fraction = -sums[k] / (sums[k + 1] - sums[k])
    low, high = max(k + 1 - _SLOPE_STEPS, 0), min(k + _SLOPE_STEPS, len(shifts_s) - 1)
    steepness = float((sums[high] - sums[low]) / (shifts_s[high] - shifts_s[low]))
    at_offset = products[:, k] + fraction * (products[:, k + 1] - products[:, k])
    count = min(max(len(products) // _BLOCK_FRAMES, _FEWEST_BLOCKS), _MOST_BLOCKS)
    blocks = np.array([block.sum() for block in np.array_split(at_offset, count)])
    sigma = math.sqrt(count / (count - 1) * float(np.square(blocks).sum()))
    if steepness <= 0.0 or sigma > _KNOWN_S * steepness:
        return None
    return float(shifts_s[k] + fraction * _STEP_S), sigma / steepness


def _lag_one(residuals: FloatArray) -> float:
    """Mean lag-one correlation of the components, from signs alone: robust (see `belie.checks.noise_scale`)."""
    signs = np.sign(residuals - np.median(residuals, axis=0))
    return float(np.sin(0.5 * np.pi * np.mean(signs[1:] * signs[:-1])))
