"""What a run leaves behind, column by column: a few numbers a frame, so that hours fit into memory."""

from __future__ import annotations

import math
import re
from array import array
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray
from belie.types import CheckResult, Claim, PoseClaim, PositionClaim, Status, Step, Verdict

STATUSES = tuple(Status)
NOT_RUN = -1
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_MARK = "\0"  # where a number was: no label of a detector holds it
_ABOUT_ONE = re.compile(r"^(.*) (\S+) is (missing|called)\b")  # an object by label and name
_QUANTITY = re.compile(r"([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*(\S.*)")


def without_numbers(reason: str) -> str:
    """A reason with its numbers struck out, so that reasons of one kind count as one.

    >>> without_numbers("lost: 12 of 400 corners found again")
    'lost: … of … corners found again'
    """
    return _NUMBER.sub("…", reason)


def object_of(reason: str) -> str | None:
    """The name of the one object that a reason is about, if it is about one.

    >>> object_of("stop sign 7 is missing: leaving the view"), object_of("no message yet")
    ('7', None)
    """
    match = _ABOUT_ONE.match(reason)
    return None if match is None else match[2]


@dataclass(slots=True)
class Reasons:
    """Counts reasons that differ in numbers or in the object's name only as one, and remembers between what they were.

    >>> reasons = Reasons()
    >>> for seconds in ("0.5", "12.0", "0.9"):
    ...     reasons.add(f"no message for {seconds} s, of 3")
    >>> reasons.counted()
    Counter({'no message for 0.5 to 12.0 s, of 3': 3})
    """

    _counts: Counter[str] = field(default_factory=Counter)
    _least: dict[str, list[str]] = field(default_factory=dict)
    _greatest: dict[str, list[str]] = field(default_factory=dict)

    def add(self, reason: str) -> None:
        """Count a reason."""
        reason = _ABOUT_ONE.sub(r"some \1 is \3", reason, count=1)
        kind, numbers = _NUMBER.sub(_MARK, reason), _NUMBER.findall(reason)
        self._counts[kind] += 1
        for bounds, choose in ((self._least, min), (self._greatest, max)):
            known = bounds.setdefault(kind, numbers)
            bounds[kind] = [choose(pair, key=float) for pair in zip(known, numbers, strict=True)]

    def counted(self) -> Counter[str]:
        """Frames by reason, with the range of each number that differs."""
        found: Counter[str] = Counter()
        for kind, frames in self._counts.items():
            between, *after = kind.split(_MARK)
            for least, greatest, text in zip(self._least[kind], self._greatest[kind], after, strict=True):
                between += (least if least == greatest else f"{least} to {greatest}") + text
            found[between] += frames
        return found


def parse_floor(text: str | None) -> dict[str, float]:
    """The minimum detectable lie as numbers by unit; what is no number is left out.

    >>> parse_floor("0.04 m/s, 0.2 deg/s")
    {'m/s': 0.04, 'deg/s': 0.2}
    """
    found = (_QUANTITY.fullmatch(part.strip()) for part in (text or "").split(","))
    return {match[2]: float(match[1]) for match in found if match is not None}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckTrace:
    """One check on one stream over all N frames of a run.

    Parameters
    ----------
    check, source : str
        What was checked; see `CheckResult`. A check of objects counts as one, by the worst object of each frame.
    statistic, threshold : array (N,)
        NaN where nothing was tested.
    units : tuple of str
        Units of the statistic, the most frequent first: a check may hold several tests.
    status : array (N,), int8
        Index into `STATUSES`; `NOT_RUN` where the check gave no answer.
    floors : mapping of str to array (N,)
        Minimum detectable lie by unit; NaN where none was stated.
    undecided : Counter
        Frames left undecided, by reason; numbers that differ are given as a range.
    """

    check: str
    source: str
    statistic: FloatArray
    threshold: FloatArray
    units: tuple[str, ...]
    status: npt.NDArray[np.int8]
    floors: Mapping[str, FloatArray]
    undecided: Counter[str]

    @property
    def ratio(self) -> FloatArray:
        """Statistic over threshold, shape (N,): above 1 the claim is contradicted."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.statistic / self.threshold)

    @property
    def frames_run(self) -> int:
        """In how many frames the check gave an answer."""
        return int(np.count_nonzero(self.status != NOT_RUN))

    @property
    def never_decided(self) -> bool:
        """Whether it ran and was undecided every time."""
        return bool(self.frames_run) and self.share(Status.UNDECIDED) == 1.0

    def share(self, status: Status) -> float:
        """Share of the frames in which the check ran that got this answer; NaN if it never ran."""
        ran = self.status != NOT_RUN
        return float(np.mean(self.status[ran] == STATUSES.index(status))) if ran.any() else math.nan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionTrace:
    """The position claims of one source: stamps (K,), metres (K, 3), and the frame they are in."""

    source: str
    frame_id: str
    stamps_ns: npt.NDArray[np.int64]
    position_m: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """All frames of a run, N of them.

    Parameters
    ----------
    frames, stamps_ns : array (N,), int64
        Number and stamp of each frame.
    status : array (N,), int8
        Index into `STATUSES`.
    latency_ms, decode_ms : array (N,)
        Time of the update, and of decoding the image (not part of it).
    checks : tuple of CheckTrace
        In the order in which they first answered.
    claimed_m, seen_m : array (N, 3)
        Where the camera is in the odometry's frame, as claimed and as the images tell; NaN where unknown.
    odometry_frame_id : str or None
        Name of the odometry's frame.
    positions : tuple of PositionTrace
        Position claims.
    """

    frames: npt.NDArray[np.int64]
    stamps_ns: npt.NDArray[np.int64]
    status: npt.NDArray[np.int8]
    latency_ms: FloatArray
    decode_ms: FloatArray
    checks: tuple[CheckTrace, ...]
    claimed_m: FloatArray
    seen_m: FloatArray
    odometry_frame_id: str | None
    positions: tuple[PositionTrace, ...]

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def seconds(self) -> FloatArray:
        """Time of each frame since the first one, seconds, shape (N,)."""
        return self.since_start_s(self.stamps_ns)

    def since_start_s(self, stamps_ns: npt.ArrayLike) -> FloatArray:
        """Stamps as seconds since the first frame."""
        start_ns = self.stamps_ns[0] if len(self) else 0
        return np.asarray((np.asarray(stamps_ns, dtype=np.int64) - start_ns) * 1e-9)

    def frame_at(self, stamp_ns: int) -> int:
        """Number of the frame that is stamped nearest to `stamp_ns`."""
        after = int(np.searchsorted(self.stamps_ns, stamp_ns))
        near = [index for index in (after - 1, after) if 0 <= index < len(self)]
        return int(self.frames[min(near, key=lambda index: abs(int(self.stamps_ns[index]) - stamp_ns))])

    def share(self, status: Status) -> float:
        """Share of the frames with this verdict; NaN without frames."""
        return float(np.mean(self.status == STATUSES.index(status))) if len(self) else math.nan


@dataclass(slots=True)
class _CheckColumns:
    statistic: array[float]
    threshold: array[float]
    status: array[int]
    floors: dict[str, array[float]] = field(default_factory=dict)
    units: Counter[str] = field(default_factory=Counter)
    undecided: Reasons = field(default_factory=Reasons)

    @classmethod
    def after(cls, frames: int) -> _CheckColumns:
        """Columns of a check that answers for the first time after `frames` frames."""
        return cls(_gap(frames), _gap(frames), array("b", [NOT_RUN]) * frames)

    def pad(self, frames: int) -> None:
        """Fill up to `frames` entries: the check gave no answer there."""
        missing = frames - len(self.status)
        self.status.extend([NOT_RUN] * missing)
        for column in (self.statistic, self.threshold, *self.floors.values()):
            column.extend(_gap(frames - len(column)))

    def add(self, result: CheckResult) -> None:
        before = len(self.status)
        self.statistic.append(math.nan if result.statistic is None else result.statistic)
        self.threshold.append(math.nan if result.threshold is None else result.threshold)
        self.status.append(STATUSES.index(result.status))
        for unit, value in parse_floor(result.floor).items():
            column = self.floors.setdefault(unit, _gap(before))
            column.extend(_gap(before - len(column)))
            column.append(value)
        if result.statistic is not None:
            self.units[result.unit] += 1
        if result.status is Status.UNDECIDED:
            self.undecided.add(result.reason)


def _gap(length: int) -> array[float]:
    return array("d", [math.nan]) * max(length, 0)


def _urgency(result: CheckResult) -> float:
    """Sorts the worst of a check's answers first; those without a statistic keep their order."""
    if result.object is None or result.status is not Status.CONTRADICTED:
        return 0.0
    return -(result.statistic or 0.0) - 1.0


class TraceRecorder:
    """Collects a `Trace`, frame by frame.

    Examples
    --------
    >>> from belie.types import Frame
    >>> frame = Frame(camera="/image", stamp_ns=5, received_ns=5, image=np.zeros((2, 2), np.uint8))
    >>> result = CheckResult(check="odometry", source="/odom", status=Status.CONSISTENT, statistic=1.0,
    ...                      threshold=4.0, floor="0.1 m/s")
    >>> recorder = TraceRecorder()
    >>> recorder.add(Step(frame=frame), Verdict(frame=0, stamp_ns=5, status=Status.CONSISTENT, latency_ms=2.0,
    ...                                         checks=(result,)))
    >>> trace = recorder.finish()
    >>> trace.checks[0].ratio, trace.checks[0].floors
    (array([0.25]), {'m/s': array([0.1])})
    """

    def __init__(self) -> None:
        self._frames, self._stamps_ns, self._status = array("q"), array("q"), array("b")
        self._latency_ms, self._decode_ms = array("f"), array("f")
        self._claimed_m, self._seen_m = array("d"), array("d")
        self._checks: dict[tuple[str, str], _CheckColumns] = {}
        self._positions: dict[tuple[str, str], tuple[array[int], array[float]]] = {}
        self._odometry_frame_id: str | None = None

    def add(
        self,
        step: Step,
        verdict: Verdict,
        T_odom_cam_claimed: SE3 | None = None,
        T_odom_cam_seen: SE3 | None = None,
    ) -> None:
        """Take in one frame, its verdict, and where the camera was claimed and seen to be."""
        done = len(self._frames)
        self._frames.append(verdict.frame)
        self._stamps_ns.append(verdict.stamp_ns)
        self._status.append(STATUSES.index(verdict.status))
        self._latency_ms.append(verdict.latency_ms)
        self._decode_ms.append(step.decode_ms)
        for column, T in ((self._claimed_m, T_odom_cam_claimed), (self._seen_m, T_odom_cam_seen)):
            column.extend([math.nan] * 3 if T is None else T.t.tolist())
        for result in sorted(verdict.checks, key=_urgency):
            key = (result.check, result.source)
            columns = self._checks.setdefault(key, _CheckColumns.after(done))
            if len(columns.status) == done:  # once a frame; of several objects, the worst
                columns.add(result)
        for columns in self._checks.values():
            columns.pad(done + 1)
        self._add_positions(step.claims)

    def _add_positions(self, claims: Iterable[Claim]) -> None:
        for claim in claims:
            if isinstance(claim, PositionClaim):
                columns = self._positions.setdefault((claim.source, claim.frame_id), (array("q"), array("d")))
                columns[0].append(claim.stamp_ns)
                columns[1].extend(claim.position_m.tolist())
            elif isinstance(claim, PoseClaim):
                self._odometry_frame_id = claim.frame_id

    def finish(self) -> Trace:
        """The trace of all frames so far."""
        return Trace(
            frames=np.array(self._frames, dtype=np.int64),
            stamps_ns=np.array(self._stamps_ns, dtype=np.int64),
            status=np.array(self._status, dtype=np.int8),
            latency_ms=np.array(self._latency_ms, dtype=np.float64),
            decode_ms=np.array(self._decode_ms, dtype=np.float64),
            checks=tuple(_check_trace(key, columns) for key, columns in self._checks.items()),
            claimed_m=np.array(self._claimed_m).reshape(-1, 3),
            seen_m=np.array(self._seen_m).reshape(-1, 3),
            odometry_frame_id=self._odometry_frame_id,
            positions=tuple(
                PositionTrace(
                    source=source,
                    frame_id=frame_id,
                    stamps_ns=np.array(stamps, dtype=np.int64),
                    position_m=np.array(metres).reshape(-1, 3),
                )
                for (source, frame_id), (stamps, metres) in self._positions.items()
            ),
        )


def _check_trace(key: tuple[str, str], columns: _CheckColumns) -> CheckTrace:
    return CheckTrace(
        check=key[0],
        source=key[1],
        statistic=np.array(columns.statistic),
        threshold=np.array(columns.threshold),
        units=tuple(unit for unit, _ in columns.units.most_common()),
        status=np.array(columns.status, dtype=np.int8),
        floors={unit: np.array(column) for unit, column in columns.floors.items()},
        undecided=columns.undecided.counted(),
    )
