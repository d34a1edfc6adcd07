"""What object detectors told in a run, and of how many of their objects anything could be said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from belie.checks.objects import ObjectSettings
from belie.checks.objects.class_groups import ClassGroups
from belie.detector import ObjectView
from belie.detector.association import named
from belie.detector.covering import LEAST_CORNERS
from belie.detector.places import in_view
from belie.evaluation.box_timing import BoxTiming
from belie.geometry.boxes import longer_side
from belie.types import Claim, DetectionClaim


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldObjects:
    """What one detector told.

    Parameters
    ----------
    source : str
        The detector.
    messages, boxes : int
        How many messages came, and objects in them.
    labels : mapping of str to int
        Boxes by their label.
    renamed : mapping of (str, str) to int
        Of those, boxes whose object (track id) first came under another label: by that label, and by theirs.
    objects : int
        How many different ones were followed.
    unjudged : mapping of str to int, or None
        Of those, how many could never be judged, by the reason; None where that is not known.
    asked : int
        Frames with a message, for each object that could be judged once, since it had been told of often enough.
    withheld : mapping of str to int
        In how many of those it could not be judged, by the reason.
    late_frames : int
        By how many frames its boxes are told late, as far as is sure; negative where they are early.
    """

    source: str
    messages: int
    boxes: int
    labels: Mapping[str, int]
    objects: int
    unjudged: Mapping[str, int] | None = None
    asked: int = 0
    withheld: Mapping[str, int] = field(default_factory=dict)
    late_frames: int = 0
    renamed: Mapping[tuple[str, str], int] = field(default_factory=dict)

    def ungrouped(self, classes: ClassGroups) -> dict[str, int]:
        """Boxes under labels that no group holds, the most frequent first; but for what first came as something known.

        >>> told = ToldObjects(source="/d", messages=1, boxes=3, labels={"Car": 2, "wombat": 1}, objects=3, unjudged={})
        >>> told.ungrouped(ClassGroups())
        {'wombat': 1}
        """

        def is_known(label: str) -> bool:
            return classes.of(label) in classes.groups

        found = Counter({label: n for label, n in self.labels.items() if not is_known(label)})
        for (first, label), count in self.renamed.items():
            found[label] -= count * is_known(first)
        return dict((+found).most_common())

    @property
    def is_unchecked(self) -> bool:
        """Whether no box was followed, so that nothing that was told of objects could be checked."""
        return self.unjudged is not None and self.boxes > 0 and not self.objects

    def in_words(self) -> str:
        """Messages, boxes and objects, and how many of these could not be judged, with the main reason.

        >>> ToldObjects(source="/d", messages=9, boxes=12, labels={}, objects=3, unjudged={"small": 1}).in_words()
        '/d: 9 messages, 12 boxes, 3 objects; 2 could be judged, 1 never (mainly: small)'
        """
        said = f"{self.source}: {self.messages} messages, {self.boxes} boxes"
        if self.unjudged is None:
            return said
        said += f", {self.objects} objects"
        if self.is_unchecked:
            return (
                f"{said}: no box could be followed, so none was checked (too small, outside the image, "
                "without an image box, or in images that were not fit to judge by)"
            )
        if not self.objects:
            return said
        said += f"; {self.objects - sum(self.unjudged.values())} could be judged"
        if self.withheld:
            share = sum(self.withheld.values()) / self.asked
            said += f" but for {share:.0%} of their messages ({_main(self.withheld)})"
        if self.unjudged:
            said += f", {sum(self.unjudged.values())} never ({_main(self.unjudged)})"
        return said

    def timing_in_words(self) -> str:
        """That its boxes are about other frames, and what to do; empty where nothing is amiss.

        >>> told = ToldObjects(source="/d", messages=9, boxes=12, labels={}, objects=3, late_frames=-1)
        >>> told.timing_in_words().partition(".")[0]
        '/d: its boxes are told about 1 frame early: they move as their pixels do 1 frame later'
        """
        count = abs(self.late_frames)
        frames = f"{count} frame{'s' * (count > 1)}"
        if self.late_frames > 0:
            amiss = f"{frames} late: they move as their pixels did {frames} before"
            change = f"subtract {count} from"
        elif self.late_frames < 0:
            amiss = f"{frames} early: they move as their pixels do {frames} later"
            change = f"add {count} to"
        else:
            return ""
        return (
            f"{self.source}: its boxes are told about {amiss}. Alerts about its objects mean little until you {change} "
            "the frame numbers of its file, or set the stamps of its messages to those of the images"
        )


def _main(reasons: Mapping[str, int]) -> str:
    return f"mainly: {max(reasons, key=lambda reason: reasons[reason])}"


@dataclass(slots=True)
class _Object:
    """How far one object came on the way to a judgement; None in `lacks` where it once came to its end."""

    passed: int = -1
    lacks: str | None = ""
    asked: int = 0
    withheld: Counter[str] = field(default_factory=Counter)


@dataclass(slots=True)
class _Stream:
    messages: int = 0
    boxes: int = 0
    first_labels: dict[str, str] = field(default_factory=dict)
    labels: Counter[str] = field(default_factory=Counter)
    renamed: Counter[tuple[str, str]] = field(default_factory=Counter)
    objects: dict[int, _Object] = field(default_factory=dict)
    timing: BoxTiming = field(default_factory=BoxTiming)


class ToldObjectsRecorder:
    """Collects `ToldObjects`, frame by frame; memory grows with the number of objects alone.

    An object counts as judged where, in one frame, it had been told of often enough, was large enough, inside the
    image, and had enough corners that move with it: what its absence is asked first
    (`belie.detector.object_track.ObjectTrack.absence`), as far as an `ObjectView` tells it.

    Parameters
    ----------
    settings : ObjectSettings, optional
        What is enough; where it is left out, objects are only counted.

    Examples
    --------
    >>> from belie.types import Detection
    >>> recorder = ToldObjectsRecorder()
    >>> car = Detection(label="car", score=0.9, track_id="7", box_px=[0, 0, 40, 30])
    >>> recorder.hear([DetectionClaim(source="/d", stamp_ns=0, received_ns=0, detections=(car,))])
    >>> recorder.finish()[0].in_words()
    '/d: 1 messages, 1 boxes'
    """

    def __init__(self, settings: ObjectSettings | None = None) -> None:
        self._settings = settings
        self._streams: dict[str, _Stream] = {}

    def hear(self, claims: Iterable[Claim]) -> None:
        """Take in the claims that came with a frame."""
        for claim in claims:
            if not isinstance(claim, DetectionClaim):
                continue
            stream = self._streams.setdefault(claim.source, _Stream())
            stream.messages += 1
            stream.boxes += len(claim.detections)
            for detection in named(claim.detections):
                label = detection.label
                stream.labels[label] += 1
                if not detection.track_id:
                    continue
                first = stream.first_labels.setdefault(detection.track_id, label)
                stream.renamed[first, label] += first != label

    def see(self, views: Sequence[ObjectView], size: tuple[int, int], stamp_ns: int) -> None:
        """Take in the objects after a frame of (width, height)."""
        for source, stream in self._streams.items():
            stream.timing.see((view for view in views if view.source == source), size, stamp_ns)
        for view in views:
            known = self._streams.setdefault(view.source, _Stream()).objects.setdefault(
                view.number, _Object()
            )
            if self._settings is None:
                continue
            asked = demands(self._settings, view, size)
            passed = next((index for index, (holds, _) in enumerate(asked) if not holds), None)
            if passed is None:
                known.lacks = None
            elif known.lacks is not None and passed > known.passed:
                known.passed, known.lacks = passed, asked[passed][1]
            if passed != 0 and view.status != "not told":
                known.asked += 1
                if passed is not None:
                    known.withheld[asked[passed][1]] += 1

    def finish(self) -> tuple[ToldObjects, ...]:
        """What was told so far, a detector each."""
        return tuple(self._told(source, stream) for source, stream in self._streams.items())

    def _told(self, source: str, stream: _Stream) -> ToldObjects:
        objects = stream.objects.values()
        judged = [known for known in objects if known.lacks is None]
        unjudged = Counter(known.lacks for known in objects if known.lacks is not None)
        return ToldObjects(
            source=source,
            messages=stream.messages,
            boxes=stream.boxes,
            labels=dict(stream.labels),
            renamed=dict(+stream.renamed),
            objects=len(objects),
            unjudged=None if self._settings is None else unjudged,
            asked=sum(known.asked for known in judged),
            withheld=sum((known.withheld for known in judged), Counter[str]()),
            late_frames=stream.timing.late_frames(),
        )


def demands(s: ObjectSettings, view: ObjectView, size: tuple[int, int]) -> list[tuple[bool, str]]:
    """What must hold before an absence or another name means anything, and what is said where it does not.

    `size` is the image's: width, height.
    """
    return [
        (view.is_established, "told of too seldom or unsurely"),
        (longer_side(view.box_px) >= s.least_side_px, f"smaller than {s.least_side_px:g} px"),
        (
            in_view(view.box_px, size) >= s.least_in_view,
            f"less than {s.least_in_view:.0%} of it in the image",
        ),
        (len(view.observed_px) >= LEAST_CORNERS, f"fewer than {LEAST_CORNERS} corners that move with it"),
    ]
