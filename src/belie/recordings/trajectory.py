"""Trajectories in folders: rows of numbers to pose claims and position claims."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3
from belie.types import PoseClaim, PositionClaim, RecordingError

ODOMETRY_SOURCE = "/odom"
POSITION_SOURCE = "/position"


def nanoseconds(seconds: str) -> int:
    """Seconds, as text, to integer nanoseconds without the detour over a float.

    >>> nanoseconds("1305031102.175304")
    1305031102175304000

    Raises
    ------
    ValueError
        If it is no finite number.
    """
    try:
        value = Decimal(seconds)
        return int((value * 1_000_000_000).to_integral_value())
    except (InvalidOperation, OverflowError, ValueError) as error:
        raise ValueError(f"{seconds!r} is no time in seconds") from error


def even_stamps_ns(count: int, rate_hz: float) -> npt.NDArray[np.int64]:
    """Times of `count` frames at a steady rate from 0, shape (count,).

    >>> even_stamps_ns(3, 30.0).tolist()
    [0, 33333333, 66666667]
    """
    return np.asarray(np.rint(np.arange(count) * (1e9 / rate_hz)), dtype=np.int64)


def rows_of(path: Path, *, separator: str | None = None) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each line that is neither empty nor a comment; in UTF-8, with or without a mark.

    Raises
    ------
    RecordingError
        If the file cannot be read as text.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} cannot be read as text; if it is text, save it as UTF-8") from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from error
    for number, line in enumerate(lines, start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, [field.strip() for field in line.split(separator)]


def numbers_of(path: Path, number: int, fields: list[str], expected: str) -> list[float]:
    """The fields of one row as finite numbers.

    Raises
    ------
    RecordingError
        Names file, line and what was expected.

    >>> numbers_of(Path("times.txt"), 1, ["0.5", "1"], "two numbers")
    [0.5, 1.0]
    """
    try:
        values = [float(field) for field in fields]
    except ValueError:
        values = []
    if not values or not np.isfinite(values).all():
        raise RecordingError(f"{path}, line {number}: expected {expected}, found {' '.join(fields)[:80]!r}")
    return values


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Poses of the body in a world frame, by time.

    Parameters
    ----------
    path : Path
        Where it was read.
    stamps_ns : array (N,)
        Times.
    poses : tuple of SE3
        ``T_world_body``, one for each time.
    """

    path: Path
    stamps_ns: npt.NDArray[np.int64]
    poses: tuple[SE3, ...]

    def odometry(self) -> Iterator[PoseClaim]:
        """The trajectory as claims of odometry."""
        for stamp_ns, T_world_body in zip(self.stamps_ns.tolist(), self.poses, strict=True):
            yield PoseClaim(
                source=ODOMETRY_SOURCE,
                frame_id="world",
                stamp_ns=stamp_ns,
                received_ns=stamp_ns,
                T_odom_body=T_world_body,
            )

    def positions(self) -> Iterator[PositionClaim]:
        """The trajectory as claims of localisation."""
        for stamp_ns, T_world_body in zip(self.stamps_ns.tolist(), self.poses, strict=True):
            yield PositionClaim(
                source=POSITION_SOURCE,
                frame_id="world",
                kind="localisation",
                stamp_ns=stamp_ns,
                received_ns=stamp_ns,
                position_m=T_world_body.t,
            )


def read_tum(path: Path) -> Trajectory:
    r"""A trajectory in TUM's form: ``seconds tx ty tz qx qy qz qw`` a line.

    Raises
    ------
    RecordingError
        Names the first line that is malformed, holds NaN or a zero quaternion.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "groundtruth.txt"
    ...     _ = file.write_text("# a comment\n0.5 1 2 3 0 0 0 1\n")
    ...     trajectory = read_tum(file)
    >>> trajectory.stamps_ns.tolist(), trajectory.poses[0].t.tolist()
    ([500000000], [1.0, 2.0, 3.0])
    >>> next(trajectory.positions()).kind
    'localisation'
    """
    stamps_ns, poses = [], []
    for number, fields in rows_of(path):
        expected = "8 numbers (seconds tx ty tz qx qy qz qw)"
        if len(fields) != 8:
            raise RecordingError(f"{path}, line {number}: expected {expected}, found {len(fields)} fields")
        values = numbers_of(path, number, fields, expected)
        try:
            poses.append(SE3.from_quat_xyzw(values[4:], values[1:4]))
            stamps_ns.append(nanoseconds(fields[0]))
        except ValueError as error:
            raise RecordingError(f"{path}, line {number}: {error}") from error
    if not poses:
        raise RecordingError(f"{path} holds no poses")
    return Trajectory(path=path, stamps_ns=np.array(stamps_ns, dtype=np.int64), poses=tuple(poses))
