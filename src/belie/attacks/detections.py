"""Attacks on what a detector claims to see: objects hidden, relabelled, moved, invented, exchanged, or shown late."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from belie.attacks.misplaced import shifted, shrunk
from belie.attacks.objects import Follower, Sightings, same_object
from belie.attacks.phantom import Form, Phantom, new_track_id
from belie.attacks.plan import Plan
from belie.attacks.stale import StaleForger
from belie.attacks.stream import Upstream, nothing_to_attack, reading
from belie.attacks.telling import Telling
from belie.geometry import CameraModel
from belie.types import AttackError, Claim, Detection, DetectionClaim, Step

# How long an object must have been told of before its absence or another name means anything, generously.
_FRAMES_TO_KNOW = 10


def detection_steps(plan: Plan, upstream: Upstream) -> Iterator[Step]:
    """The steps of `upstream` with detections forged.

    Raises
    ------
    AttackError
        At the end, where there was nothing to forge.
    """
    attack = DetectionAttack(plan)
    with reading(upstream) as steps:
        for step in steps:
            yield replace(step, claims=tuple(attack.forge(claim) for claim in step.claims))
    if not attack.onsets:
        raise attack.nothing_to_forge()


class DetectionAttack:
    """One attack in one pass over a recording; all streams that it selects tell the same lie.

    Attributes
    ----------
    object : str or None
        Track id of the attacked object (the phantom's own); None where the detector gives none, or where all objects
        are attacked (delay).
    other : str or None
        The second object of a swap.
    onsets : dict of str to int
        Stamp of the first message that lies, by source.
    ends : dict of str to int
        Stamp of the first honest message after the last one that lies, by source; none where none came.

    Examples
    --------
    >>> from belie.attacks import parse_attack
    >>> from belie.attacks.timing import FrameClock
    >>> plan = Plan.of(parse_attack("detections-relabel:start=1"), FrameClock(np.arange(9)), "flu")
    >>> attack = DetectionAttack(plan)
    >>> car = Detection(label="car", score=0.9, track_id="7", box_px=[0, 0, 4, 3])
    >>> claim = DetectionClaim(source="/detections", stamp_ns=1, received_ns=1, detections=(car,))
    >>> attack.forge(claim).detections[0].label, attack.object, attack.onsets
    ('bird', '7', {'/detections': 1})
    """

    def __init__(self, plan: Plan) -> None:
        self.object: str | None = None
        self.other: str | None = None
        self.onsets: dict[str, int] = {}
        self.ends: dict[str, int] = {}
        self._plan = plan
        self._model: CameraModel | None = plan.camera.model if plan.camera is not None else None
        self._streams: dict[str, _Stream] = {}
        self._telling = Telling(plan)
        self._named = None if plan.spec.kind == "phantom" else plan.spec["object"]
        self._lead: Follower | None = None
        self._second: Follower | None = None
        self._phantom: Phantom | None = None

    def forge(self, claim: Claim) -> Claim:
        """What is sent instead of `claim`: itself, where it is not attacked."""
        if not isinstance(claim, DetectionClaim) or not self._plan.selects(claim):
            return claim
        stream = self._streams.setdefault(claim.source, _Stream(self._plan, self._model))
        self._telling.hear(claim)
        lie = claim
        if self._plan.span.holds(claim.stamp_ns):
            lie = self._lie(claim, stream)
            if lie is not claim:
                self.onsets[claim.source] = min(claim.stamp_ns, self.onsets.get(claim.source, claim.stamp_ns))
                self.ends.pop(claim.source, None)
        elif claim.stamp_ns < self._plan.span.start_ns:
            stream.stale.before(claim)
        if lie is claim and claim.source in self.onsets:
            self.ends.setdefault(claim.source, claim.stamp_ns)
        stream.seen.add(claim)
        return lie

    def nothing_to_forge(self, present: tuple[str, ...] = ()) -> AttackError:
        """The error for an attack that changed nothing: why, and what there is instead."""
        if not self._streams:
            return nothing_to_attack(self._plan, present)
        return AttackError(f"{self._plan.spec.to_text()}: {self._why_nothing()}")

    def caution(self) -> str:
        """That an object is first told of in the attack, and what to do; empty where all are told of before."""
        names = () if self._phantom is not None else (self.object, self.other)
        for name in filter(None, names):
            first = self._telling.first_frame(name)
            if first >= self._plan.span.start_frame:
                return (
                    f"{self._plan.spec.to_text()}: object {name} is first told of in frame {first}: start at "
                    f"{first + _FRAMES_TO_KNOW} or later, what is hidden or renamed from its first frame on cannot be "
                    "seen while that lasts"
                )
        return ""

    def _why_nothing(self) -> str:
        """Why nothing was changed, where there are detections."""
        spec, span = self._plan.spec, self._plan.span
        frames = f"in frames {span.start_frame} to {span.stop_frame}"
        if silence := self._telling.silence():
            is_known = self._named is None or self._telling.elsewhere(str(self._named))
            unknown = "" if is_known else f"object {self._named} is never told of, and "
            return f"{unknown}no detections {frames}: {silence}"
        present = self._telling.present()
        if self._lead is None:
            if self._named is None:
                return f"no object to attack {frames}; {present}"
            return self._missing(str(self._named), "to attack", frames)
        name = f"object {self._lead.name}".rstrip()
        if spec.kind == "swap":
            if spec["other"] is None:
                return f"no second object to swap {self._lead.name} with {frames}; {present}"
            return self._missing(str(spec["other"]), f"to swap {self._lead.name} with", frames)
        if spec.kind == "relabel" or (spec.kind == "patch" and spec["mode"] == "relabel"):
            return f"{name} is called {spec['to']} already {frames}; give another label with to="
        return f"{name} is told of {frames}, but nothing of it came to be changed; let the attack last longer"

    def _missing(self, name: str, purpose: str, frames: str) -> str:
        elsewhere = self._telling.elsewhere(name)
        told = f" ({elsewhere})" if elsewhere else ""
        return f"no object {name} {purpose} {frames}{told}; {self._telling.present()}"

    def _lie(self, claim: DetectionClaim, stream: _Stream) -> DetectionClaim:
        match self._plan.spec.kind:
            case "phantom":
                return self._with_phantom(claim, stream)
            case "delay" if self._named is None:
                return _if_other(claim, stream.stale.during(claim))
        index = self._target(claim, stream)
        match self._plan.spec.kind:
            case "delay":
                return self._target_delayed(claim, stream, index)
            case "swap":
                return self._swapped(claim, stream, index)
        if index is None:
            return claim
        forged = self._forged(claim.detections[index], claim.stamp_ns)
        if forged is claim.detections[index]:
            return claim
        return _with(claim, index, forged)

    def _forged(self, target: Detection, stamp_ns: int) -> Detection | None:
        """The target as it is claimed; None where it is left out."""
        spec = self._plan.spec
        kind = spec.kind
        if kind == "patch":
            # By stamp alone, so that the streams of one detector are fooled together.
            tag = zlib.crc32(spec.name.encode())
            rng = np.random.default_rng([int(spec.number("seed")), tag, stamp_ns])
            if rng.random() >= spec.number("rate"):
                return target
            kind = str(spec["mode"])
        match kind:
            case "hide":
                return None
            case "relabel":
                return target if target.label == spec["to"] else replace(target, label=str(spec["to"]))
            case "shift":
                return shifted(target, spec.number("dx"), spec.number("dy"), self._model)
            case _:
                return shrunk(target, spec.number("factor"))

    def _target(self, claim: DetectionClaim, stream: _Stream) -> int | None:
        """Index of the attacked object in a message; the first message with objects in the span decides which."""
        if self._lead is None:
            self._choose(claim, stream)
        if self._lead is None:
            return None
        if stream.target is None:
            stream.target = Follower(self._lead.name, self._lead.last, self._lead.last_ns, self._model)
        return stream.target.find(claim, stream.seen)

    def _choose(self, claim: DetectionClaim, stream: _Stream) -> None:
        found = claim.detections
        ranked = stream.seen.ranked(claim)
        if self._named is not None:
            ranked = [index for index in ranked if found[index].track_id == self._named]
        if not ranked:
            return
        first = found[ranked[0]]
        self._lead = Follower(first.track_id, first, claim.stamp_ns, self._model)
        self.object = first.track_id or None

    def _swapped(self, claim: DetectionClaim, stream: _Stream, index: int | None) -> DetectionClaim:
        if self._lead is None:
            return claim
        if self._second is None:
            self._second = self._choose_second(claim, stream, self._lead)
        if self._second is None:
            return claim
        if stream.second is None:
            stream.second = Follower(self._second.name, self._second.last, self._second.last_ns, self._model)
        second = stream.second.find(claim, stream.seen)
        for place, name in ((index, self._second.name), (second, self._lead.name)):
            if place is not None:
                claim = _with(claim, place, replace(claim.detections[place], track_id=name))
        return claim

    def _choose_second(self, claim: DetectionClaim, stream: _Stream, first: Follower) -> Follower | None:
        """The object to swap ids with; None as long as it does not show."""
        if not first.name:
            raise AttackError(
                f"{self._plan.spec.to_text()}: {claim.source} gives no track ids that could be swapped"
            )
        wanted = self._plan.spec["other"]
        for index in stream.seen.ranked(claim):
            other = claim.detections[index]
            if other.track_id and other.track_id != first.name and wanted in (None, other.track_id):
                self.other = other.track_id
                return Follower(other.track_id, other, claim.stamp_ns, self._model)
        return None

    def _target_delayed(self, claim: DetectionClaim, stream: _Stream, index: int | None) -> DetectionClaim:
        """The message with its target as it was some time ago."""
        old = stream.stale.during(claim)
        if self._lead is None or stream.target is None or not isinstance(old, DetectionClaim):
            return claim
        wanted = claim.detections[index] if index is not None else stream.target.last
        place = None if wanted is None else same_object(wanted, old.detections, self._model)
        stale = None if place is None else old.detections[place]
        if index is None:
            return claim if stale is None else replace(claim, detections=(*claim.detections, stale))
        return _with(claim, index, stale)

    def _with_phantom(self, claim: DetectionClaim, stream: _Stream) -> DetectionClaim:
        for detection in claim.detections:
            stream.form.learn(detection)
        if self._phantom is None:
            if self._plan.camera is None:
                raise AttackError(
                    f"{self._plan.spec.to_text()}: the recording has no camera to place it before"
                )
            self._phantom = Phantom(self._plan, self._plan.camera)
            taken = {name for other in self._streams.values() for name in other.seen.labels}
            self.object = new_track_id(
                self._plan, taken | {detection.track_id for detection in claim.detections}
            )
        has_ids = bool(stream.seen.labels) or not (stream.seen.nameless or claim.detections)
        has_ids = has_ids or any(detection.track_id for detection in claim.detections)
        if not has_ids:
            stream.gives_ids = False
            if all(not other.gives_ids for other in self._streams.values()):
                self.object = None
        phantom = self._phantom.seen(claim.stamp_ns, stream.form, (self.object or "") if has_ids else "")
        return claim if phantom is None else replace(claim, detections=(*claim.detections, phantom))


class _Stream:
    """What an attack remembers of one source."""

    def __init__(self, plan: Plan, model: CameraModel | None) -> None:
        self.seen = Sightings(model)
        self.stale = StaleForger(plan)
        self.form = Form()
        self.target: Follower | None = None
        self.second: Follower | None = None
        self.gives_ids = True


def _with(claim: DetectionClaim, index: int, forged: Detection | None) -> DetectionClaim:
    before, after = claim.detections[:index], claim.detections[index + 1 :]
    return replace(claim, detections=(*before, *(() if forged is None else (forged,)), *after))


def _if_other(claim: DetectionClaim, sent: Claim) -> DetectionClaim:
    return sent if isinstance(sent, DetectionClaim) else claim
