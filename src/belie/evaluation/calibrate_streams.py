"""What attack-free driving shows of a robot's motion streams: the clock of each against the images', its correlation.

The claimed rotation between two images, read at times shifted by tau, is held against the one that the images show.
Where the robot turns unevenly the sum of squared differences has a minimum at the stream's clock offset; its
curvature says how well that is known: ``sigma_tau^2 = s^2 (1 + phi) / (1 - phi) / sum |d r / d tau|^2``, with s^2 the
variance and phi the lag-one correlation of the differences r.
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

_STEP_S, _MOST_S = 0.01, 0.12
SHIFTS_S: tuple[float, ...] = tuple(float(x) for x in np.arange(-12, 13) * _STEP_S)
_WAIT_NS = 400_000_000  # until the claims of all shifts are there
_LEAST_FRAMES = 40
_KNOWN_S = 0.02  # standard deviation of an offset that is worth telling


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


def stream_notes(
    parts: Sequence[TeachingPart], config: Config, advance: Callable[[], None]
) -> list[StreamNote]:
    """Every motion stream of the recordings, pooled by its name.

    >>> stream_notes([], Config(), lambda: None)
    []
    """
    found: dict[StreamKey, list[FloatArray]] = {}
    for part in parts:
        for key, residuals in _residuals(part, config, advance).items():
            found.setdefault(key, []).append(residuals)
    return [_note(key, several) for key, several in found.items()]


def _residuals(
    part: TeachingPart, config: Config, advance: Callable[[], None]
) -> Mapping[StreamKey, FloatArray]:
    """Rotation residuals of each stream, (frames, shifts, 3), rad a second; NaN where a stream has a gap."""
    ((_, camera),) = part.cameras.items()
    detector, streams = Detector(part.cameras, config), Streams(config.streams)
    waiting: deque[_Interval] = deque()
    rows: dict[StreamKey, list[FloatArray]] = {}

    def settle(until_ns: int) -> None:
        while waiting and waiting[0].stop_ns <= until_ns:
            interval = waiting.popleft()
            for key, row in _row(interval, streams, camera.T_body_cam).items():
                rows.setdefault(key, []).append(row)

    for step in part.steps():
        detector.update(step.frame, step.claims)
        streams.take(step.claims, step.frame.stamp_ns)
        estimate = detector.estimate
        if estimate is not None and estimate.inliers > 0:
            waiting.append(_Interval(estimate.previous_stamp_ns, estimate.stamp_ns, estimate.T_prev_cur))
        settle(step.frame.stamp_ns - _WAIT_NS)
        advance()
    return {key: np.array(several) for key, several in rows.items()}


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


def _note(key: StreamKey, several: Sequence[FloatArray]) -> StreamNote:
    check, source = key
    whole = [part[np.isfinite(part).all(axis=(1, 2))] for part in several]
    # A bias (gyroscope) is no clock offset: it is the same at every shift.
    empty = np.empty((0, len(SHIFTS_S), 3))
    centred = np.concatenate([empty, *(part - np.median(part, axis=0) for part in whole if len(part))])
    middle = len(SHIFTS_S) // 2
    if len(centred) < _LEAST_FRAMES:
        return StreamNote(
            check=check, source=source, offset_s=None, sigma_s=None, correlation=math.nan, frames=len(centred)
        )
    scale = np.median(np.abs(centred[:, middle])) * 1.4826 + 1e-9
    cost = np.minimum((centred / scale) ** 2, 9.0).sum(axis=(0, 2))
    best = int(np.argmin(cost))
    correlation = _lag_one(centred[:, best])
    slope = np.gradient(centred, _STEP_S, axis=1)[:, best]
    inside = 0 < best < len(SHIFTS_S) - 1
    spread = float(np.median(np.abs(centred[:, best])) * 1.4826)
    information = float((slope**2).sum())
    rho = min(max(correlation, 0.0), 0.95)
    sigma_s = spread * math.sqrt((1.0 + rho) / (1.0 - rho) / information) if information > 0.0 else math.inf
    if not inside or sigma_s > _KNOWN_S:
        return StreamNote(
            check=check,
            source=source,
            offset_s=None,
            sigma_s=None,
            correlation=correlation,
            frames=len(centred),
        )
    before, here, after = (float(cost[best + d]) for d in (-1, 0, 1))
    curve = before - 2.0 * here + after
    fraction = 0.5 * (before - after) / curve if curve > 0.0 else 0.0
    return StreamNote(
        check=check, source=source, offset_s=SHIFTS_S[best] + fraction * _STEP_S, sigma_s=sigma_s,
        correlation=correlation, frames=len(centred),
    )  # fmt: skip


def _lag_one(residuals: FloatArray) -> float:
    """Mean lag-one correlation of the components, from signs alone: robust (see `belie.checks.noise_scale`)."""
    signs = np.sign(residuals - np.median(residuals, axis=0))
    return float(np.sin(0.5 * np.pi * np.mean(signs[1:] * signs[:-1])))
