"""A detector over a recording: one pass, and what it leaves for tables, scores and the report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from belie.attacks import AttackLabel
from belie.detector import ObjectView
from belie.evaluation.attacked_objects import AttackedObjects
from belie.evaluation.expected_corners import View
from belie.evaluation.film import Film, FilmRecorder
from belie.evaluation.followed import ObjectFollower
from belie.evaluation.score import RaisedAlert, Score, score
from belie.evaluation.snapshots import Snapshot, SnapshotRecorder
from belie.evaluation.told_objects import ToldObjects, ToldObjectsRecorder
from belie.evaluation.trace import STATUSES, Trace, TraceRecorder
from belie.evaluation.traced_alert import AlertRecorder, TracedAlert
from belie.geometry import SE3
from belie.recordings import BodyAxes
from belie.types import (
    Claim,
    Frame,
    MountedCamera,
    RecordingError,
    Settings,
    Step,
    Verdict,
    VisualEstimate,
)


class FrameChecker(Protocol):
    """What a run asks of a detector; `belie.detector.Detector` is one."""

    @property
    def estimate(self) -> VisualEstimate | None:
        """What the images said of the last frame."""
        ...

    @property
    def T_odom_cam_claimed(self) -> SE3 | None:
        """Where the odometry says that the camera was."""
        ...

    @property
    def T_odom_cam_seen(self) -> SE3 | None:
        """Where the images say that it was."""
        ...

    @property
    def objects(self) -> tuple[ObjectView, ...]:
        """The objects that detectors told of."""
        ...

    def update(self, frame: Frame, claims: Iterable[Claim]) -> Verdict:
        """The answer for one frame."""
        ...


class Checked(Protocol):
    """What a run asks of a recording: `belie.recordings.Recording`, plain or attacked."""

    @property
    def path(self) -> Path:
        """Where it is."""
        ...

    @property
    def format(self) -> str:
        """What it is."""
        ...

    @property
    def body_axes(self) -> BodyAxes:
        """How the body frame lies in the vehicle."""
        ...

    @property
    def join_counts(self) -> Any:
        """What the joining of the streams met."""
        ...

    @property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The cameras by name."""
        ...

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of all frames, shape (N,)."""
        ...

    def steps(self) -> Iterator[Step]:
        """Frames with their claims."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """One pass of a detector over a recording; made by `run_detector`.

    Parameters
    ----------
    source, format : str
        Where the recording is and what it is.
    body_axes : "flu" or "rdf"
        How the body frame lies in the vehicle.
    cameras : mapping of str to MountedCamera
        The cameras.
    config : Settings
        The detector's settings.
    version : str
        Of belie.
    trace : Trace
        A few numbers a frame.
    alerts : tuple of TracedAlert
        In order.
    snapshots : tuple of Snapshot
        Pictures at the alerts, or of the frame nearest to one.
    films : tuple of Film
        Of the objects that alerts name.
    attacked : tuple of Film
        Of the objects that labels name, where the run was given any; they have shots where it kept pictures.
    join_counts : mapping
        For each kind of mishap in joining the streams, how often it befell each stream.
    told : tuple of ToldObjects
        What each object detector told.
    """

    source: str
    format: str
    body_axes: str
    cameras: Mapping[str, MountedCamera]
    config: Settings
    version: str
    trace: Trace
    alerts: tuple[TracedAlert, ...]
    snapshots: tuple[Snapshot, ...]
    films: tuple[Film, ...]
    attacked: tuple[Film, ...]
    join_counts: Mapping[str, Mapping[str, int]]
    told: tuple[ToldObjects, ...] = ()

    @property
    def profile(self) -> str:
        """``default`` or ``paper``."""
        return str(getattr(self.config, "profile", "default"))

    @property
    def has_claims(self) -> bool:
        """Whether any stream made a claim; without one, only the camera itself was checked."""
        return any(check.check != "camera" for check in self.trace.checks)

    def verdicts(self) -> Iterator[Verdict]:
        """The verdicts without their checks: what `score` needs."""
        trace = self.trace
        raised: dict[int, list[RaisedAlert]] = {}
        for alert in self.alerts:
            raised.setdefault(alert.raised.frame, []).append(alert.raised)
        for index in range(len(trace)):
            frame = int(trace.frames[index])
            yield Verdict(
                frame=frame,
                stamp_ns=int(trace.stamps_ns[index]),
                status=STATUSES[int(trace.status[index])],
                latency_ms=float(trace.latency_ms[index]),
                alerts=tuple(one.alert for one in raised.get(frame, ())),
            )

    def score(self, labels: Iterable[AttackLabel]) -> Score:
        """Hits, misses, delays and false alerts; see `belie.evaluation.score`."""
        return score(self.verdicts(), labels)

    def undecided_reasons(self) -> list[tuple[str, str, int]]:
        """(check, reason, frames) of all that stayed undecided, the most frequent first."""
        counted: Counter[tuple[str, str]] = Counter()
        for check in self.trace.checks:
            for reason, frames in check.undecided.items():
                counted[f"{check.check} {check.source}", reason] += frames
        return [(check, reason, frames) for (check, reason), frames in counted.most_common()]


def run_detector(
    recording: Checked,
    config: Settings,
    *,
    detector: FrameChecker | None = None,
    labels: Iterable[AttackLabel] | None = None,
    on_verdict: Callable[[Verdict], None] | None = None,
    pictures: bool = True,
) -> Run:
    """Check a recording from its first frame to its last; memory stays flat.

    Parameters
    ----------
    recording : Recording
        Plain or attacked.
    config : Config
        Settings of the detector.
    detector : Detector, optional
        A fresh one; by default it is made from `config`.
    labels : iterable of AttackLabel, optional
        What was attacked, if it is known: whose objects raised no alert can then be told, and why.
    on_verdict : callable, optional
        Is given every verdict as soon as it is there.
    pictures : bool
        Whether to keep those that a report shows; of thirty objects they cost as much as half of their checks.

    Raises
    ------
    RecordingError
        If the recording cannot be read, or holds no frame.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from belie.types import Status
    >>> def steps():
    ...     image = np.zeros((48, 64), np.uint8)
    ...     yield from (Step(frame=Frame(camera="/image", stamp_ns=t, received_ns=t, image=image))
    ...                 for t in (0, 10))
    >>> recording = SimpleNamespace(path="x", format="made", body_axes="flu", cameras={}, join_counts=None,
    ...                             steps=steps)
    >>> blind = SimpleNamespace(estimate=None, T_odom_cam_claimed=None, T_odom_cam_seen=None, objects=(),
    ...     update=lambda frame, claims: Verdict(frame=frame.stamp_ns // 10, stamp_ns=frame.stamp_ns,
    ...                                          status=Status.UNDECIDED, latency_ms=1.0))
    >>> run = run_detector(recording, Settings(), detector=blind)
    >>> len(run.trace), run.trace.share(Status.UNDECIDED)
    (2, 1.0)
    """
    detector = detector or _detector(recording.cameras, config)
    trace = TraceRecorder()
    alerts, films, follower = AlertRecorder(), FilmRecorder(), ObjectFollower(recording.cameras)
    claims_predict = getattr(config, "profile", "default") == "paper"
    objects_settings = None if claims_predict else getattr(config, "objects", None)
    attacked, told = AttackedObjects(labels or (), objects_settings), ToldObjectsRecorder(objects_settings)
    snapshots = SnapshotRecorder(recording.cameras, claims_predict=claims_predict)
    with closing(_closable(recording.steps())) as steps:
        for step in steps:
            verdict = detector.update(step.frame, step.claims)
            claimed, seen = detector.T_odom_cam_claimed, detector.T_odom_cam_seen
            trace.add(step, verdict, claimed, seen)
            views = detector.objects
            objects = follower.add(step.frame, step.claims, views)
            alerts.add(verdict)
            told.hear(step.claims)
            told.see(views, (step.frame.image.shape[1], step.frame.image.shape[0]), step.frame.stamp_ns)
            if pictures:
                films.add(step.frame, objects, verdict)
                view = View(
                    number=verdict.frame, frame=step.frame, T_odom_cam_claimed=claimed, T_odom_cam_seen=seen
                )
                snapshots.add(view, verdict, detector.estimate, objects)
            attacked.add(step.frame, objects, verdict, films.past if pictures else None)
            if on_verdict is not None:
                on_verdict(verdict)
    finished = trace.finish()
    if not len(finished):
        raise RecordingError(f"{recording.path} holds no frame that could be checked")
    return Run(
        source=str(recording.path),
        format=recording.format,
        body_axes=recording.body_axes,
        cameras=recording.cameras,
        config=config,
        version=version("belie"),
        trace=finished,
        alerts=alerts.finish(),
        snapshots=snapshots.finish(),
        films=films.finish(),
        attacked=attacked.finish(),
        join_counts=_counts(recording.join_counts),
        told=told.finish(),
    )


def _detector(cameras: Mapping[str, MountedCamera], config: Settings) -> FrameChecker:
    from belie.detector import Config, Detector

    if not isinstance(config, Config):
        raise ValueError(f"the settings must be a Config, got {type(config).__name__}")
    return Detector(cameras, config)


def _closable(steps: Iterator[Step]) -> Any:
    return steps if hasattr(steps, "close") else (step for step in steps)


def _counts(join_counts: Any) -> dict[str, dict[str, int]]:
    """What befell which stream; kinds and streams without a count are left out."""
    names = getattr(type(join_counts), "__slots__", ())
    found = {name: {k: v for k, v in getattr(join_counts, name).items() if v} for name in names}
    return {name: streams for name, streams in found.items() if streams}
