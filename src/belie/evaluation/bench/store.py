"""The results folder: one JSON and one Parquet file a run, named by the run's key; what is there need not run again.

::

    results/SUITE/
        index.html, table.md      what it all came to
        suite.toml                what was run
        runs/KEY.json             one run: what was attacked, what came of it
        runs/KEY.failed.json      a run that failed, with its traceback; tried again next time
        frames/KEY.parquet        every frame's verdict; the folder is one Parquet data set
        reports/KEY.html          reports of single runs
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from belie.attacks import AttackLabel
from belie.evaluation.bench.cases import RunCase
from belie.evaluation.bench.measure import FrameTable, Measured
from belie.types import MissingExtraError, RecordingError

_INTEGERS = ("frame", "stamp_ns")
_REALS = ("latency_ms", "decode_ms", "statistic", "threshold")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRecord:
    """A finished run as it is kept: plain values.

    Parameters
    ----------
    key, rival, recording, place, weather : str
        Which run.
    seed : int
        Of the world (simulated) or the claims' noise (real).
    family, goal, spec : str or None
        The attack; None for an honest run.
    magnitude, unit, within, onset, stop
        Of the attack; the frame `stop` is honest again.
    not_applicable : str or None
        Why the attack could not be tried on this recording; nothing below then means anything.
    alert : str or None
        The type of alert that the attack calls for.
    caught : bool or None
        Whether the right alert was raised within the attack (and within `within` frames); None for an honest run.
    delay_frames, delay_ms
        From the onset to it.
    right_first : bool or None
        Whether the first alert within the attack named the right kind and source (and object, where both name one).
    during : int
        Alerts within the attack that it does not explain; those about honest frames after it are not among them.
    why_missed, nearest
        See `belie.evaluation.bench.misses.Miss`; of an attack that was not caught.
    object_px : (int, int) or None
        Width and height of the attacked object's box at the onset.
    wrong, false_alerts, before_onset, aftermath : list of str
        Alerts that the attack does not explain; raised outside of it; those before it; `Score.aftermath`.
    honest_s : float
        Seconds outside the attack.
    frames, undecided : int
        Judged, and left without an answer.
    latency_ms, decode_ms, seeing_ms : list of float
        Frame by frame, the first few left out: of the update; of decoding, apart; of visual odometry, part of the
        update, where the detector tells.
    size : str
        Of the images.
    episodes, delays : dict
        See `belie.evaluation.bench.sweep.Exceedances`.
    """

    key: str
    rival: str
    recording: str
    place: str
    weather: str
    seed: int
    family: str | None = None
    goal: str | None = None
    spec: str | None = None
    magnitude: float | None = None
    unit: str = ""
    within: int | None = None
    onset: int | None = None
    stop: int | None = None
    not_applicable: str | None = None
    alert: str | None = None
    caught: bool | None = None
    delay_frames: int | None = None
    delay_ms: float | None = None
    right_first: bool | None = None
    during: int = 0
    why_missed: str = ""
    nearest: float | None = None
    object_px: tuple[int, int] | None = None
    wrong: tuple[str, ...] = ()
    false_alerts: tuple[str, ...] = ()
    before_onset: tuple[str, ...] = ()
    aftermath: tuple[str, ...] = ()
    honest_s: float = 0.0
    frames: int = 0
    undecided: int = 0
    latency_ms: tuple[float, ...] = ()
    decode_ms: tuple[float, ...] = ()
    seeing_ms: tuple[float, ...] = ()
    size: str = ""
    episodes: dict[str, list[int]] | None = None
    delays: dict[str, list[int | None]] | None = None


def record_of(
    case: RunCase,
    key: str,
    found: Measured | None,
    labels: Iterable[AttackLabel],
    *,
    size: str = "",
    why_not: str = "",
) -> RunRecord:
    """The record of a run that came to `found`, or of one that could not be tried, and why."""
    attack, recording = case.attack, case.recording
    known: dict[str, Any] = {
        "key": key, "rival": case.rival, "recording": recording.name, "place": recording.place,
        "weather": recording.weather,
        "seed": recording.scenario.seed if hasattr(recording, "scenario") else recording.seed,
    }  # fmt: skip
    if attack is not None:
        known |= {name: value for name, value in asdict(attack).items() if name != "target"}
    if found is None:
        return RunRecord(**known, not_applicable=why_not)
    label = next(iter(labels), None)
    if label is not None:
        (scored,) = found.score.labels
        late = (
            attack is not None and attack.within is not None and (scored.delay_frames or 0) >= attack.within
        )
        known |= {
            "alert": label.alert.value,
            "stop": label.stop_frame,
            "caught": scored.hit is not None and not late,
            "delay_frames": scored.delay_frames,
            "delay_ms": scored.delay_ms,
            "why_missed": f"found later than {attack.within} frames" if attack and late else found.miss.why,
            "nearest": found.miss.nearest,
        }
    said = found.score
    return RunRecord(
        **known,
        right_first=found.right_first,
        during=found.during,
        wrong=tuple(_words(said.wrong_attributions)),
        false_alerts=tuple(_words(said.false_alerts)),
        before_onset=tuple(_words(said.before_onset)),
        aftermath=tuple(_words(said.aftermath)),
        honest_s=said.honest_s,
        frames=found.frames,
        undecided=found.undecided,
        latency_ms=tuple(round(x, 3) for x in found.latency_ms),
        decode_ms=tuple(round(x, 3) for x in found.decode_ms),
        seeing_ms=tuple(round(x, 3) for x in found.seeing_ms),
        size=size,
        episodes=found.exceeded.episodes,
        delays=found.exceeded.delay_frames,
    )


def _words(raised: Iterable[Any]) -> Iterator[str]:
    for one in raised:
        of_object = f" object {one.alert.object}" if one.alert.object else ""
        yield f"frame {one.frame}: {one.alert.type.value} {one.alert.source}{of_object}"


@dataclass(frozen=True)
class Store:
    """The results of one suite in a folder.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = Store(Path(folder))
    ...     store.open()
    ...     store.save(RunRecord(key="a", rival="default", recording="x", place="x", weather="sunny", seed=1), None)
    ...     store.finished(["a", "b"]), store.load(["a"])[0].rival
    (['a'], 'default')
    """

    folder: Path

    @cached_property
    def runs(self) -> Path:
        """Of the records."""
        return self.folder / "runs"

    @cached_property
    def frames(self) -> Path:
        """Of the Parquet files."""
        return self.folder / "frames"

    def open(self) -> None:
        """Make the folders.

        Raises
        ------
        RecordingError
            If they cannot be made.
        """
        try:
            for path in (self.runs, self.frames, self.folder / "reports"):
                path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"cannot write results to {self.folder}: {error.strerror}") from None

    def save(self, record: RunRecord, table: FrameTable | None) -> None:
        """Keep a finished run; the record comes last, so that a run is finished or not there at all."""
        if table is not None:
            write_parquet(self.frames / f"{record.key}.parquet", table, record)
        (self.runs / f"{record.key}.failed.json").unlink(missing_ok=True)
        _write_json(self.runs / f"{record.key}.json", asdict(record))

    def fail(self, name: str, key: str, error: str, trace: str = "") -> None:
        """Note that a run failed, why in a line, and the traceback."""
        entry = {"key": key, "run": name, "error": error, "traceback": trace}
        _write_json(self.runs / f"{key}.failed.json", entry)

    def loop_path(self, key: str) -> Path:
        """Where the outcome of a closed loop is kept."""
        return self.runs / f"{key}.loop.json"

    def save_loop(self, key: str, outcome: dict[str, Any]) -> None:
        """Keep the outcome of a closed loop."""
        _write_json(self.loop_path(key), outcome)

    def finished(self, keys: Iterable[str]) -> list[str]:
        """Those of the keys whose runs need not run again."""
        there = {path.name for path in self.runs.glob("*.json")} if self.runs.is_dir() else set[str]()
        return [key for key in keys if f"{key}.json" in there or f"{key}.loop.json" in there]

    def settled(self, keys: Iterable[str]) -> int:
        """How many of the keys have finished or failed."""
        there = {path.name.split(".")[0] for path in self.runs.glob("*.json")}
        return sum(key in there for key in keys)

    def forget_failures(self) -> None:
        """Failed runs are tried again."""
        for path in self.runs.glob("*.failed.json"):
            path.unlink(missing_ok=True)

    def failures(self, keys: Iterable[str]) -> list[tuple[str, str]]:
        """Run and error of every failed run."""
        found = [self.runs / f"{key}.failed.json" for key in keys]
        entries = [json.loads(path.read_text(encoding="utf-8")) for path in found if path.exists()]
        return [(entry["run"], entry["error"]) for entry in entries]

    def load(self, keys: Iterable[str]) -> list[RunRecord]:
        """The records of finished runs."""
        paths = [self.runs / f"{key}.json" for key in keys]
        return [RunRecord(**_plain(path)) for path in paths if path.exists()]


def _plain(path: Path) -> dict[str, Any]:
    entries = json.loads(path.read_text(encoding="utf-8"))
    return {name: tuple(value) if isinstance(value, list) else value for name, value in entries.items()}


def write_parquet(path: Path, table: FrameTable, record: RunRecord) -> None:
    """Every frame's answers, with the run that they are of.

    Raises
    ------
    MissingExtraError
        Without ``pyarrow``.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingExtraError("pyarrow", "bench") from None
    count = len(table.columns["frame"])
    arrays = {
        name: pa.array([value] * count, pa.string()).dictionary_encode()
        for name, value in (
            ("run", record.key), ("rival", record.rival), ("recording", record.recording),
            ("weather", record.weather), ("attack", record.spec),
        )
    }  # fmt: skip
    for name, column in table.columns.items():
        if name in _INTEGERS:
            arrays[name] = pa.array(column, pa.int64())
        elif name in _REALS:
            arrays[name] = pa.array([None if v is None else np.float64(v) for v in column], pa.float64())
        else:
            arrays[name] = pa.array(column, pa.string()).dictionary_encode()
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    pq.write_table(pa.table(arrays), partial, compression="zstd")
    partial.replace(path)


def _write_json(path: Path, value: Any) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    partial.write_text(json.dumps(value), encoding="utf-8")
    partial.replace(path)
