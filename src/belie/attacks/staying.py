"""Which object an attack is about where none is named: one that stays in view, so that it is an attack at all.

The largest object is often a parked car that is about to pass: to leave out what leaves anyway harms nobody, and no
detector should say a word. The paper's obstacle stands or drives ahead.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import combinations, islice

import numpy as np

from belie.attacks.attacked import attack
from belie.attacks.objects import image_box_px
from belie.attacks.source import Source
from belie.attacks.spec import AttackSpec, parse_attack
from belie.attacks.stream import reading
from belie.attacks.timing import FrameClock
from belie.geometry import FloatArray
from belie.geometry.boxes import are_apart, longer_side
from belie.types import DetectionClaim

# Frames around the onset: known before, and in view well past the paper's ten frames.
_BEFORE, _AFTER = 15, 25
_LEAST_AFTER = 10  # frames: in fewer, nobody could miss it
_LAST = 3  # messages of the time for which it has to stay, of which one must tell of it: detectors flicker
_SHARE = 0.8  # of the messages in which the honest detector reports it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StayingObject:
    """An object that a detector tells of from well before an attack to well after its onset.

    Parameters
    ----------
    source, track_id, label : str
        Who tells of it, and under which names.
    box_px : array (4,)
        Its box when the attack begins: left, top, right, bottom edge.
    least_px : float
        The longer side of its smallest box since the attack began.
    first_frame, last_frame : int
        In which frames it is told of first, and last as far as the recording was read.
    missed_last : int
        How many messages came after that without it.
    """

    source: str
    track_id: str
    label: str
    box_px: FloatArray
    least_px: float
    first_frame: int
    last_frame: int
    missed_last: int

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of that box."""
        width, height = np.rint(self.box_px[2:] - self.box_px[:2]).astype(int).tolist()
        return width, height


def staying_objects(
    source: Source, start_frame: int, stop_frame: int | None = None, *, topic: str | None = None
) -> list[StayingObject]:
    """The objects with a track id that stay, the largest first; an empty list where none does.

    Parameters
    ----------
    source : Source
        Is read up to `stop_frame`.
    start_frame, stop_frame : int
        An object stays if it is told of from 15 frames before the first to the second, by default 25 frames later.
    topic : str, optional
        The one detector that counts.
    """
    stop = start_frame + _AFTER if stop_frame is None else stop_frame
    return _staying(*_listen(source, start_frame, stop, topic))


def _listen(
    source: Source, start: int, stop: int, topic: str | None
) -> tuple[Counter[str], dict[tuple[str, str], _Told]]:
    """Messages around the attack by detector, and what is told of each (detector, track id) up to frame `stop`."""
    model = next((mounted.model for mounted in source.cameras.values()), None)
    messages: Counter[str] = Counter()
    told: dict[tuple[str, str], _Told] = {}
    with reading(source.steps) as steps:
        for number, step in enumerate(islice(steps, stop)):
            for claim in step.claims:
                if not isinstance(claim, DetectionClaim) or topic not in (None, claim.source):
                    continue
                is_near = number >= start - _BEFORE
                messages[claim.source] += is_near
                for d in claim.detections:
                    box_px = image_box_px(d, model)
                    if d.track_id and box_px is not None:
                        one = told.setdefault((claim.source, d.track_id), _Told(d.label, number))
                        one.add(number, box_px, is_near=is_near, is_attacked=number >= start)
                        one.heard = messages[claim.source]
    return messages, told


def _staying(messages: Counter[str], told: dict[tuple[str, str], _Told]) -> list[StayingObject]:
    staying = [
        (one.least_px2, one.staying(*key, missed_last=messages[key[0]] - one.heard))
        for key, one in told.items()
        if messages[key[0]] > 1 and one.is_attacked and one.near >= _SHARE * messages[key[0]]
    ]
    return [one for _, one in sorted(staying, key=lambda found: -found[0])]


@dataclass(slots=True)
class _Told:
    """What was told of one object, up to now."""

    label: str
    first: int
    last: int = 0
    near: int = 0  # messages around the attack
    heard: int = 0  # the same with and without it, up to its last
    least_px: float = np.inf
    least_px2: float = np.inf
    box_px: FloatArray = field(default_factory=lambda: np.zeros(4))
    is_attacked: bool = False

    def add(self, number: int, box_px: FloatArray, *, is_near: bool, is_attacked: bool) -> None:
        self.last = number
        if is_near:
            self.near += 1
            self.least_px2 = min(self.least_px2, float(np.prod(box_px[2:] - box_px[:2])))
        if is_attacked:
            self.least_px = min(self.least_px, longer_side(box_px))
        if not self.is_attacked:  # as the attack finds it
            self.box_px, self.is_attacked = box_px, is_attacked

    def staying(self, source: str, track_id: str, *, missed_last: int) -> StayingObject:
        return StayingObject(
            source=source, track_id=track_id, label=self.label, box_px=self.box_px, least_px=self.least_px,
            first_frame=self.first, last_frame=self.last, missed_last=missed_last,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """An attack with the objects that were chosen for it.

    Parameters
    ----------
    spec : AttackSpec
        It names them, if there are any.
    objects : tuple of StayingObject
        Two of a swap, if there are two; none where the attack is about no object, or where one was named.
    stays : bool
        Whether they stay until the attack ends; otherwise they stay for ten frames at least, and none until it ends.
    lacks : bool
        Whether one, or a second one, was looked for, and none stays: the attack then takes the largest that is held.
    """

    spec: AttackSpec
    objects: tuple[StayingObject, ...] = ()
    stays: bool = True
    lacks: bool = False


def choose_objects(
    source: Source, specs: Iterable[AttackSpec | str], *, least_px: float = 0.0
) -> list[Choice]:
    """Name an object that stays in each attack that names none, of what the attacks before it leave.

    It stays until the attack ends, and for 25 frames; if none does, for as long as any does, but for ten frames at
    least. Two that swap their ids are apart: honest trackers confuse neighbours, too. An attack on all objects (delay)
    is left as it is.

    Parameters
    ----------
    source : Source
        The honest recording; it is read up to the end of the last such attack.
    specs : iterable of AttackSpec or str
        As for `attack`.
    least_px : float
        The least longer side of an object, px.

    Raises
    ------
    AttackError
        Where a specification makes no sense, or not on this recording.
    """
    chosen: list[Choice] = []
    for spec in (parse_attack(spec) if isinstance(spec, str) else spec for spec in specs):
        before = attack(source, [choice.spec for choice in chosen])
        chosen.append(_chosen(before, spec, least_px) if needs_object(spec) else Choice(spec=spec))
    return chosen


def needs_object(spec: AttackSpec) -> bool:
    """Whether an attack is about one object and names none.

    >>> [needs_object(parse_attack(text)) for text in ("detections-hide", "detections-hide:object=7", "imu-flip")]
    [True, False, False]
    """
    options = dict(spec.options)
    return "object" in options and options["object"] is None and spec.kind != "delay"


def _chosen(source: Source, spec: AttackSpec, least_px: float) -> Choice:
    clock = FrameClock(source.frame_stamps_ns())
    span = spec.span(clock)
    topic = None if spec["source"] is None else str(spec["source"])
    options = dict(spec.options)
    # To call it what it is, or to swap it with itself, is no attack.
    label, other = options.get("to"), options.get("other")
    start = span.start_frame
    ends = (max(span.stop_frame, start + _AFTER), start + _AFTER, span.stop_frame, start + _LEAST_AFTER)
    windows = sorted({min(end, len(clock)) for end in ends if end >= start + _LEAST_AFTER}, reverse=True)
    heard = [_listen(source, start, end, topic) for end in windows]
    _, longest = heard[0]
    each = [
        [
            replace(one, last_frame=longest[one.source, one.track_id].last)
            for one in _staying(*listened)
            if one.missed_last < _LAST and one.least_px >= least_px
            and one.label != label and one.track_id != other
        ]
        for listened in heard
    ]  # fmt: skip
    found = list(zip(windows, each, strict=True))
    needs_two = spec.kind == "swap" and other is None
    pairs = [(end, pair) for end, staying in found for pair in combinations(staying, 2) if _may_swap(*pair)]
    single = [(end, (one,)) for end, staying in found for one in staying[:1]]
    end, objects = ((pairs if needs_two else []) or single or [(0, ())])[0]
    named = {name: one.track_id for name, one in zip(("object", "other"), objects, strict=False)}
    return Choice(
        spec=AttackSpec.from_dict({**spec.to_dict(), **named}),
        objects=objects,
        stays=end >= span.stop_frame,
        lacks=len(objects) < 1 + needs_two,
    )


def _may_swap(one: StayingObject, other: StayingObject) -> bool:
    """Whether two objects are of one detector, and no honest tracker confuses them."""
    return one.source == other.source and are_apart(one.box_px, other.box_px)
