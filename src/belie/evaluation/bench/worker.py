"""One process's share of a suite: a recording brought into memory once, attacked and checked many times."""

from __future__ import annotations

import os
import sysconfig
import traceback
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

from belie.attacks import AttackLabel, attack, parse_attack
from belie.detector import Config
from belie.evaluation.bench.cases import RECORDED, RealCase, RecordingCase, RunCase
from belie.evaluation.bench.loops import Loop, drive
from belie.evaluation.bench.measure import Measured, measure
from belie.evaluation.bench.memory import MemoryRecording
from belie.evaluation.bench.recorded import load
from belie.evaluation.bench.rivals import RivalError, RivalMaker, rival_maker
from belie.evaluation.bench.rivals.belie_rival import BelieRival
from belie.evaluation.bench.rivals.remembered import OtherImagesError, Sight
from belie.evaluation.bench.store import Store, record_of
from belie.evaluation.bench.targets import size_px, targeted
from belie.types import AttackError, BelieError, ConfigError, MissingExtraError

_NOT_THEIRS = (str(files("belie")), *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")))


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Runs over one recording, each with its key."""

    recording: RecordingCase
    runs: tuple[tuple[RunCase, str], ...]
    store: Path
    cache: Path
    config: Config | None


@dataclass(slots=True)
class _Seen:
    """What the last honest look at a recording left for the runs that follow."""

    recording: RecordingCase
    frames: MemoryRecording
    sights: list[Sight] | None = None
    of: str = ""


_LAST: list[_Seen] = []  # of this process: tasks of one recording follow each other


def start_worker() -> None:
    """One thread a process: the processes are the parallelism."""
    import cv2

    os.environ.setdefault("OMP_NUM_THREADS", "1")
    cv2.setNumThreads(1)


def run_task(task: Task) -> None:
    """Run all of a task; what fails is noted, and does not stop the rest."""
    store = Store(task.store)
    try:
        seen = _load(task)
    except (MissingExtraError, ConfigError) as error:
        raise ConfigError(str(error)) from None  # of every run the same: it ends the suite
    except Exception as error:
        for case, key in task.runs:
            store.fail(case.name, key, _line(error), _trace(error))
        return
    for case, key in task.runs:
        try:
            maker = rival_maker(case.rival, task.config)
            _run(case, key, maker, seen, store)
        except (MissingExtraError, ConfigError) as error:
            raise ConfigError(str(error)) from None
        except Exception as error:
            store.fail(case.name, key, _line(error), _trace(error))


def _load(task: Task) -> _Seen:
    if not _LAST or _LAST[0].recording != task.recording:
        _LAST.clear()
        _LAST.append(_Seen(task.recording, load(task.recording, task.cache)))
    return _LAST[0]


def _run(case: RunCase, key: str, maker: RivalMaker, seen: _Seen, store: Store) -> None:
    if case.attack is None:
        found = _measured(maker, seen, seen.frames, camera=False)
        store.save(record_of(case, key, found, (), size=_size(seen)), found.table)
        return
    try:
        spec = targeted(seen.frames, case.attack)
        attacked = attack(seen.frames, spec)
        labels = attacked.labels
    except AttackError as error:
        store.save(record_of(case, key, None, (), why_not=f"{error}{_remedy(case)}"), None)
        return
    frames = MemoryRecording(name=case.name, cameras=seen.frames.cameras, joined=tuple(attacked.steps()))
    told = replace(case, attack=replace(case.attack, spec=spec))
    found = _measured(maker, seen, frames, camera=labels[0].stream == "camera", labels=labels)
    record = record_of(told, key, found, labels, size=_size(seen))
    if labels[0].object is not None:
        # Of a phantom only the lie tells.
        near = (
            *seen.frames.joined[max(0, case.attack.onset - 3) :][:6],
            *frames.joined[case.attack.onset :][:6],
        )
        record = replace(record, object_px=size_px(near, labels[0].object))
    store.save(record, found.table)


def _remedy(case: RunCase) -> str:
    """What to set where an attack is on what was left out of a recording."""
    made = isinstance(case.recording, RealCase) and case.recording.claims != RECORDED
    if made and case.attack is not None and parse_attack(case.attack.spec).stream == "detections":
        return f'; claims are made from poses here: claims = "{RECORDED}" takes the recording\'s own'
    return ""


def _measured(
    maker: RivalMaker,
    seen: _Seen,
    frames: MemoryRecording,
    *,
    camera: bool,
    labels: tuple[AttackLabel, ...] = (),
) -> Measured:
    """One pass; images that an earlier pass of the same detector saw are not looked at again."""
    known = seen.sights if seen.of == maker.key and not camera else None
    if known is not None:
        try:
            return measure(frames.steps(), labels, maker.remembering(frames.cameras, known))
        except OtherImagesError:
            pass  # the detector did not look at the same images this time: it must look for itself
    rival = maker.make(frames.cameras)
    found = measure(frames.steps(), labels, rival)
    if isinstance(rival, BelieRival) and rival.sights is not None and not camera:
        seen.sights, seen.of = rival.sights, maker.key
    return found


def run_loop(loop: Loop, folder: Path) -> None:
    """Drive one closed loop; a failure is noted."""
    store = Store(folder)
    try:
        drive(loop, store)
    except (MissingExtraError, ConfigError) as error:
        raise ConfigError(str(error)) from None  # of every run the same: it ends the suite
    except Exception as error:
        store.fail(loop.name, loop.key, _line(error), _trace(error))


def _size(seen: _Seen) -> str:
    (camera,) = seen.frames.cameras.values()
    return f"{camera.model.width}x{camera.model.height}"


def _line(error: Exception) -> str:
    """Kind, message and place; of belie's own errors the message, which tells what to do."""
    text = " ".join(str(error).split())
    if isinstance(error, BelieError | RivalError):
        return text
    frames = traceback.extract_tb(error.__traceback__)
    # A detector of the user's own is where to look, not what it called.
    theirs = [frame for frame in frames if not frame.filename.startswith(_NOT_THEIRS)] or frames
    place = f" ({Path(theirs[-1].filename).name}:{theirs[-1].lineno})" if theirs else ""
    return f"{type(error).__name__}: {text}{place}"


def _trace(error: Exception) -> str:
    return "".join(traceback.format_exception(error))
