"""A recording under attack: the same surface as the recording, and the labels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.attacks.camera import camera_steps
from belie.attacks.detections import DetectionAttack, detection_steps
from belie.attacks.expected_alert import expected_alert
from belie.attacks.imu import imu_steps
from belie.attacks.kind import Stream
from belie.attacks.labels import AttackLabel
from belie.attacks.odometry import odometry_steps
from belie.attacks.plan import Plan
from belie.attacks.position import position_steps
from belie.attacks.source import BodyAxes, Source
from belie.attacks.spec import AttackSpec, parse_attack
from belie.attacks.stream import Upstream, nothing_to_attack, reading
from belie.attacks.timing import NS_PER_S, FrameClock
from belie.types import (
    AttackError,
    Claim,
    DetectionClaim,
    MotionClaim,
    MountedCamera,
    PoseClaim,
    Step,
)

_STAGES = {
    "odometry": odometry_steps,
    "imu": imu_steps,
    "position": position_steps,
    "camera": camera_steps,
    "detections": detection_steps,
}
# A source that has been silent this long after the onset is not waited for in the labels.
_LABEL_WAIT_NS = 5 * NS_PER_S


def attack(source: Source, specs: AttackSpec | str | Iterable[AttackSpec | str]) -> AttackedRecording:
    """Attack a recording: the first specification acts first, the next on its outcome.

    Nothing is read yet but the frames' stamps, and `source` is never changed.

    Raises
    ------
    AttackError
        Where a specification makes no sense, or not on this recording (span, camera).

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from belie.geometry import SE3
    >>> from belie.types import Frame
    >>> def steps():
    ...     for stamp in range(0, 400_000_000, 100_000_000):
    ...         frame = Frame(camera="/image", stamp_ns=stamp, received_ns=stamp,
    ...                       image=np.zeros((4, 6), np.uint8))
    ...         pose = PoseClaim(source="/odom", frame_id="odom", stamp_ns=stamp, received_ns=stamp,
    ...                          T_odom_body=SE3.identity())
    ...         yield Step(frame=frame, claims=(pose,))
    >>> recording = SimpleNamespace(cameras={}, body_axes="flu", steps=steps,
    ...                             frame_stamps_ns=lambda: np.arange(4) * 100_000_000)
    >>> attacked = attack(recording, "odometry-offset:axis=y,rate=0.2,start=1,stop=3")
    >>> [step.claims[0].T_odom_body.t[1].item() for step in attacked.steps()]
    [0.0, 0.2, 0.4, 0.0]
    >>> attacked.labels[0].alert.value, attacked.labels[0].sources
    ('odometry_spoofing', ('/odom',))
    """
    several = [specs] if isinstance(specs, AttackSpec | str) else list(specs)
    parsed = [parse_attack(spec) if isinstance(spec, str) else spec for spec in several]
    return AttackedRecording(source, parsed)


class AttackedRecording:
    """A recording whose streams lie as specified; made by `attack`.

    It has the surface of the recording it was made from: whatever is not a stream is asked of that one.
    """

    def __init__(self, source: Source, specs: Iterable[AttackSpec]) -> None:
        self._source = source
        clock = FrameClock(source.frame_stamps_ns())
        camera = next(iter(source.cameras.values()), None)
        self._plans = tuple(Plan.of(spec, clock, source.body_axes, camera) for spec in specs)
        for plan in self._plans:
            _check_camera(plan, source.cameras)

    def __getattr__(self, name: str) -> Any:
        if name == "_source":
            raise AttributeError(name)
        return getattr(self._source, name)

    @property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The cameras by name."""
        return self._source.cameras

    @property
    def body_axes(self) -> BodyAxes:
        """How the body frame lies in the vehicle."""
        return self._source.body_axes

    @property
    def specs(self) -> tuple[AttackSpec, ...]:
        """The attacks, in the order in which they act."""
        return tuple(plan.spec for plan in self._plans)

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of all frames, in order, shape (N,); no attack changes them."""
        return self._source.frame_stamps_ns()

    def steps(self) -> Iterator[Step]:
        """The attacked steps, from the first one; the same bytes at every call.

        Raises
        ------
        AttackError
            Where an attack finds nothing to act on, or no direction to act along.
        """
        upstream: Upstream = self._source.steps
        for plan in self._plans:
            upstream = partial(_STAGES[plan.spec.stream], plan, upstream)
        return upstream()

    @cached_property
    def labels(self) -> tuple[AttackLabel, ...]:
        """One label an attack, those of an attacked source first.

        Reads the recording up to the last onset; where objects are attacked, until that ends.

        Raises
        ------
        AttackError
            Where an attack finds nothing to act on.
        """
        earlier = self._source.labels if isinstance(self._source, AttackedRecording) else ()
        last_ns = int(self.frame_stamps_ns()[-1])
        return (*earlier, *(_label(found, last_ns) for found in self._found))

    @property
    def cautions(self) -> tuple[str, ...]:
        """Why attacks on objects may pass unseen that need not, a line each; reads and raises as `labels`."""
        said = (found.detections.caution() for found in self._found if found.detections)
        return tuple(filter(None, said))

    @cached_property
    def _found(self) -> list[_Found]:
        """For every attack, the stamp of the first message that lies, by source."""
        every = [_Found(plan, self.cameras) for plan in self._plans]
        claimed = [found for found in every if found.plan.spec.stream != "camera"]
        present: dict[str, None] = {}
        enough_ns = max((found.plan.span.start_ns for found in claimed), default=0) + _LABEL_WAIT_NS
        with reading(self._source.steps if claimed else lambda: iter(())) as steps:
            for step in steps:
                for claim in step.claims:
                    present.setdefault(f"{claim.source} ({_stream_of(claim)})")
                    sent = claim
                    for found in claimed:
                        sent = found.look(sent)
                if step.frame.stamp_ns > enough_ns and all(
                    found.is_known(step.frame.stamp_ns) for found in claimed
                ):
                    break
        for found in claimed:
            if not found.onsets:
                raise found.nothing(tuple(sorted(present)))
        return every


class _Found:
    """What one attack does in the pass that makes the labels: onsets by source, and the object."""

    def __init__(self, plan: Plan, cameras: Mapping[str, MountedCamera]) -> None:
        self.plan = plan
        self.detections = DetectionAttack(plan) if plan.spec.stream == "detections" else None
        attacked = _attacked_cameras(plan, cameras)
        self.onsets = (
            self.detections.onsets if self.detections else dict.fromkeys(attacked, plan.span.start_ns)
        )

    def look(self, claim: Claim) -> Claim:
        """Take note of a claim; an object is told by what the attacks before this one leave of it."""
        if self.detections is not None:
            return self.detections.forge(claim)
        if self.plan.selects(claim) and self.plan.span.holds(claim.stamp_ns):
            self.onsets[claim.source] = min(claim.stamp_ns, self.onsets.get(claim.source, claim.stamp_ns))
        return claim

    def is_known(self, stamp_ns: int) -> bool:
        """Whether all is found once the recording is read to a time; objects may go, and come again, until the end."""
        end_ns = self.plan.span.end_ns
        is_over = self.detections is None or (end_ns is not None and stamp_ns >= end_ns)
        return bool(self.onsets) and is_over

    def span(self) -> tuple[int, int | None]:
        """First honest frame again and its stamp, None where there is none; never after the end of the plan's span."""
        span, stamps_ns = self.plan.span, self.plan.clock.stamps_ns
        ends = {} if self.detections is None else self.detections.ends
        if len(ends) < len(self.onsets):
            return span.stop_frame, span.end_ns
        stop = int(np.searchsorted(stamps_ns, max(ends.values())))
        return (stop, int(stamps_ns[stop])) if stop < span.stop_frame else (span.stop_frame, span.end_ns)

    def nothing(self, present: tuple[str, ...]) -> AttackError:
        """The error where it finds nothing to act on in a recording of these streams."""
        if self.detections is not None:
            return self.detections.nothing_to_forge(present)
        return nothing_to_attack(self.plan, present)


def _label(found: _Found, last_ns: int) -> AttackLabel:
    plan, onset_ns = found.plan, min(found.onsets.values())
    stop_frame, end_ns = found.span()
    return AttackLabel(
        name=plan.spec.name,
        text=plan.spec.to_text(),
        stream=plan.spec.stream,
        sources=tuple(sorted(found.onsets)),
        alert=expected_alert(plan.spec),
        start_frame=plan.span.start_frame,
        stop_frame=stop_frame,
        start_ns=plan.span.start_ns,
        onset_ns=onset_ns,
        end_ns=max(last_ns, onset_ns) if end_ns is None else end_ns,
        seed=int(plan.spec.number("seed")),
        object=found.detections.object if found.detections else None,
        other=found.detections.other if found.detections else None,
    )


def _stream_of(claim: Claim) -> Stream:
    match claim:
        case DetectionClaim():
            return "detections"
        case PoseClaim() | MotionClaim(kind="twist"):
            return "odometry"
        case MotionClaim():
            return "imu"
        case _:
            return "position"


def _attacked_cameras(plan: Plan, cameras: Mapping[str, MountedCamera]) -> list[str]:
    if plan.spec.stream != "camera":
        return []
    return [name for name in cameras if plan.spec["source"] in (None, name)]


def _check_camera(plan: Plan, cameras: Mapping[str, MountedCamera]) -> None:
    if plan.spec.stream == "camera" and not _attacked_cameras(plan, cameras):
        raise AttackError(f"{plan.spec.to_text()}: no such camera; the recording has {', '.join(cameras)}")
