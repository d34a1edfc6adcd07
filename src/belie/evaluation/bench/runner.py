"""Runs a suite: recording by recording over processes; interrupted it resumes, and one failure stops nothing else."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path

from belie.attacks import parse_attack
from belie.attacks.expected_alert import expected_alert
from belie.detector import Config
from belie.evaluation.bench.cache import CacheSettings, make_room
from belie.evaluation.bench.cases import RecordingCase, RunCase, runs_of
from belie.evaluation.bench.loops import Loop, loops_of
from belie.evaluation.bench.rivals import RivalMaker, rival_maker
from belie.evaluation.bench.store import Store
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.worker import Task, run_loop, run_task, start_worker
from belie.types import ConfigError

_MOST_ATTEMPTS = 2  # of a task whose process died
_RUNS_A_TASK = 60  # so that what a failing process takes with it is little, and the bar moves
_LOOK_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What running a suite came to.

    Parameters
    ----------
    keys : tuple of str
        Of all runs of the matrix, in its order.
    resumed : int
        How many had been finished before.
    failures : tuple of (str, str)
        Run and error of those that failed.
    """

    keys: tuple[str, ...]
    resumed: int
    failures: tuple[tuple[str, str], ...]


def run_suite(
    suite: Suite,
    store: Store,
    *,
    cache: CacheSettings,
    config: Config | None = None,
    jobs: int = 2,
    on_progress: Callable[[int, int], None] | None = None,
) -> Outcome:
    """Run what is not finished yet.

    Parameters
    ----------
    suite : Suite
        What to run.
    store : Store
        Where results go, and finished runs are found.
    cache : CacheSettings
        Of rendered pictures.
    config : Config, optional
        Settings of belie's own profiles.
    jobs : int
        Processes.
    on_progress : callable, optional
        Is told how many runs are settled, and of how many.

    Raises
    ------
    ConfigError
        Before anything runs: on an unknown rival, scenario or recording.
    """
    makers = {name: rival_maker(name, config) for name in suite.rivals}
    matrix = [
        (recording, [c for c in cases if _is_judged(c, makers[c.rival])])
        for recording, cases in runs_of(suite)
    ]
    keys = [case.key(makers[case.rival].key) for _, cases in matrix for case in cases]
    loops = loops_of(suite.closed_loop, config)
    keys += [loop.key for loop in loops]
    store.open()
    store.forget_failures()
    done = set(store.finished(keys))
    folder = cache.path()
    tasks = [
        task
        for recording, cases in matrix
        for task in _tasks(recording, cases, makers, done, store, folder, config)
    ]
    report = on_progress or (lambda settled, total: None)
    report(len(done), len(keys))
    jobs = 1 if suite.alone else jobs
    left = [loop for loop in loops if loop.key not in done]
    if left:
        _drive(left, jobs, lambda: report(store.settled(keys), len(keys)), store)
    if tasks:
        _run(tasks, jobs, lambda: report(store.settled(keys), len(keys)), store)
        make_room(folder, cache.limit_gb)
    report(store.settled(keys), len(keys))
    return Outcome(keys=tuple(keys), resumed=len(done), failures=tuple(store.failures(keys)))


def _is_judged(case: RunCase, maker: RivalMaker) -> bool:
    """Whether the detector can answer such an attack at all; others are not run on it."""
    return case.attack is None or expected_alert(parse_attack(case.attack.spec)) in maker.judges


def _tasks(
    recording: RecordingCase,
    cases: Sequence[RunCase],
    makers: dict[str, RivalMaker],
    done: set[str],
    store: Store,
    cache: Path,
    config: Config | None,
) -> list[Task]:
    """What is left to run on a recording, in portions."""
    left = [(case, key) for case in cases if (key := case.key(makers[case.rival].key)) not in done]
    return [
        Task(
            recording=recording,
            runs=tuple(left[start : start + _RUNS_A_TASK]),
            store=store.folder,
            cache=cache,
            config=config,
        )
        for start in range(0, len(left), _RUNS_A_TASK)
    ]


@dataclass(slots=True)
class _Attempts:
    task: Task
    count: int = field(default=0)


def _run(tasks: Sequence[Task], jobs: int, look: Callable[[], None], store: Store) -> None:
    """All tasks; where a process dies, its task is tried once more on its own, then given up."""
    waiting = [_Attempts(task) for task in tasks]
    context = multiprocessing.get_context("spawn")  # the renderer's threads do not survive a fork
    while waiting:
        broken: list[_Attempts] = []
        alone = waiting[0].count > 0
        batch, waiting = (waiting[:1], waiting[1:]) if alone else (waiting, [])
        with ProcessPoolExecutor(1 if alone else jobs, mp_context=context, initializer=start_worker) as pool:
            running: dict[Future[None], _Attempts] = {pool.submit(run_task, one.task): one for one in batch}
            try:
                while running:
                    ready, _ = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
                    look()
                    for future in ready:
                        one = running.pop(future)
                        error = future.exception()
                        if isinstance(error, BrokenProcessPool):
                            broken.append(_Attempts(one.task, one.count + 1))
                        elif isinstance(error, ConfigError):
                            raise error
                        elif error is not None:
                            _give_up(one.task, store, f"{type(error).__name__}: {error}")
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        for one in broken:
            if one.count >= _MOST_ATTEMPTS:
                _give_up(one.task, store, "its process died twice (out of memory?)")
            else:
                waiting.append(one)


def _drive(loops: Sequence[Loop], jobs: int, look: Callable[[], None], store: Store) -> None:
    """All closed loops."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=start_worker) as pool:
        running = {pool.submit(run_loop, loop, store.folder): loop for loop in loops}
        while running:
            ready, _ = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
            look()
            for future in ready:
                loop, error = running.pop(future), future.exception()
                if isinstance(error, ConfigError):
                    raise error
                if error is not None:
                    store.fail(loop.name, loop.key, f"{type(error).__name__}: {error}")


def _give_up(task: Task, store: Store, why: str) -> None:
    done = set(store.finished(key for _, key in task.runs))
    for case, key in task.runs:
        if key not in done:
            store.fail(case.name, key, why)
