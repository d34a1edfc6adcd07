"""The objects that labels say were attacked: filmed through the attack, in case that it raises no alert."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from belie.attacks import AttackLabel
from belie.checks.objects import ObjectSettings
from belie.detector.alerts import ALERT_OF_CHECK
from belie.detector.places import in_view
from belie.evaluation.film import OBJECT_ALERTS, Film, Shot, bare_shot
from belie.evaluation.followed import FollowedObject
from belie.evaluation.told_objects import demands
from belie.evaluation.trace import Reasons, object_of
from belie.geometry.boxes import box_iou
from belie.types import Alert, AlertType, CheckResult, Frame, Status, Verdict

_AFTER = 6  # frames that a film goes on after the attack
_MOST_SHOTS = 120
_IT = "it is "


@dataclass(slots=True)
class _Watched:
    """One attacked object."""

    label: AttackLabel
    one: FollowedObject | None = None  # as it was last followed
    kind: str = ""  # what it was when its attack began: a new name may be believed later
    shots: list[Shot] = field(default_factory=list)
    in_view: float = 1.0  # share of it, as it was last followed before the attack
    after: int = 0
    frames: int = 0  # attacked
    followed: int = 0
    reported: int = 0
    least_overlap: float = 1.0
    called: set[str] = field(default_factory=set)
    other_ids: set[str] = field(default_factory=set)
    misnamed: int = 0
    peak: float = 0.0  # of the evidence, as a share of what an alarm takes
    reasons: Reasons = field(default_factory=Reasons)  # that the right check gave, about it or about none
    unproven: Counter[str] = field(
        default_factory=Counter
    )  # frames of the lie in which its pixels proved nothing


class AttackedObjects:
    """Films each object that a label names, from before its attack until after it.

    Parameters
    ----------
    labels : iterable of AttackLabel
        What was attacked.
    settings : ObjectSettings, optional
        What its pixels must show before they tell anything; where it is left out, only the checks' reasons are told.

    Examples
    --------
    >>> AttackedObjects(()).finish()
    ()
    """

    def __init__(self, labels: Iterable[AttackLabel], settings: ObjectSettings | None = None) -> None:
        self._settings = settings
        self._watched = [
            _Watched(label) for label in labels if label.object is not None and label.alert in OBJECT_ALERTS
        ]

    def add(
        self,
        frame: Frame,
        objects: Iterable[FollowedObject],
        verdict: Verdict,
        past: Mapping[tuple[str, int], Sequence[Shot]] | None = None,
    ) -> None:
        """Take in a frame, its objects, the verdict on it, and the last shots of each object, if films are wanted."""
        seen = {one.key: one for one in objects}
        for watched in self._watched:
            if watched.after < _AFTER:
                _follow(watched, frame, seen, verdict, past, self._settings)

    def finish(self) -> tuple[Film, ...]:
        """One film of each object that was ever followed; it has shots where those of objects were given."""
        return tuple(_film(watched) for watched in self._watched if watched.one is not None)


def _follow(
    watched: _Watched,
    frame: Frame,
    seen: Mapping[tuple[str, int], FollowedObject],
    verdict: Verdict,
    past: Mapping[tuple[str, int], Sequence[Shot]] | None,
    settings: ObjectSettings | None,
) -> None:
    label, stamp_ns = watched.label, frame.stamp_ns
    size = (frame.image.shape[1], frame.image.shape[0])
    named = [o for o in seen.values() if o.view.source in label.sources and o.view.name == label.object]
    is_over = stamp_ns >= label.end_ns
    is_before = stamp_ns < label.start_ns
    one = None if watched.one is None else seen.get(watched.one.key)
    # While it is attacked, another object may bear its name.
    if named and (watched.one is None or (one is None and is_over) or (is_before and one not in named)):
        one = named[0]
    if one is not None:
        watched.one = one
        watched.kind = one.view.label if is_before or not watched.kind else watched.kind
        watched.in_view = in_view(one.view.box_px, size) if is_before else watched.in_view
        if past is not None:
            watched.shots = _joined([] if is_before else watched.shots, past[one.key])
    elif past is not None and watched.one is not None and not is_before and len(watched.shots) < _MOST_SHOTS:
        watched.shots.append(bare_shot(frame, watched.one.view.box_px, verdict.frame))
    del watched.shots[_MOST_SHOTS:]
    watched.after += is_over
    if watched.one is not None and not is_before and not is_over:
        _note(watched, one, verdict)
        if one is not None and settings is not None:
            _note_unproven(watched, one, settings, size)


def _joined(shots: list[Shot], newer: Sequence[Shot]) -> list[Shot]:
    """Shots in order; a newer one of the same frame knows more, as messages may come late."""
    known = {shot.stamp_ns: shot for shot in shots} | {shot.stamp_ns: shot for shot in newer}
    return [known[stamp_ns] for stamp_ns in sorted(known)]


def _note_unproven(
    watched: _Watched, one: FollowedObject, settings: ObjectSettings, size: tuple[int, int]
) -> None:
    """Why its pixels cannot tell, in a frame in which it is lied about."""
    view = one.view
    if watched.label.alert is AlertType.OBSTACLE_INJECTION:
        watched.unproven.update([view.unseen] if view.unseen else [])
    elif view.misnamed or view.status == "missing":
        lacking = [said for holds, said in demands(settings, view, size) if not holds]
        watched.unproven.update(lacking[:1])


def _note(watched: _Watched, one: FollowedObject | None, verdict: Verdict) -> None:
    """What is known of an attacked frame."""
    label = watched.label
    watched.frames += 1
    if one is not None:
        view = one.view
        watched.followed += 1
        watched.misnamed += view.misnamed
        if view.detected_px is not None:
            watched.reported += 1
            watched.called.add(view.told_label)
            watched.other_ids |= {view.told_id} - {"", label.object}
            watched.least_overlap = min(watched.least_overlap, box_iou(view.box_px, view.detected_px))
    for result in verdict.checks:
        if ALERT_OF_CHECK.get(result.check) is label.alert and result.source in label.sources:
            if result.object == label.object and result.statistic is not None and result.threshold:
                watched.peak = max(watched.peak, result.statistic / result.threshold)
            if _is_telling(result, label.object):
                watched.reasons.add(_without_name(result.reason))


def _is_telling(result: CheckResult, name: str | None) -> bool:
    """Whether it says why nothing is said of an object: a doubt about another one does not."""
    about = object_of(result.reason)
    return about == name if about is not None else result.status is Status.UNDECIDED


def _without_name(reason: str) -> str:
    """Of a reason about one object: its name may hold digits, and those are no number that differs."""
    name = object_of(reason)
    return reason if name is None else f"{_IT}{reason.partition(f' {name} is ')[2]}"


def _film(watched: _Watched) -> Film:
    label, one = watched.label, watched.one
    assert one is not None
    alert = Alert(type=label.alert, source=one.view.source, onset_ns=label.onset_ns, object=label.object)
    return Film(
        alert=alert, raised_ns=None, label=watched.kind, told_label=one.view.told_label, attack=label,
        told_id=next(iter(sorted(watched.other_ids)), ""), is_swapped=bool(watched.other_ids),
        shots=tuple(watched.shots), since_ns=one.view.met_ns, why=_why(watched),
    )  # fmt: skip


def _why(watched: _Watched) -> str:
    """Why it was not accused, as far as can be told."""
    name = f"{watched.kind} {watched.label.object}"
    said = []
    if not watched.followed:
        share = f": {watched.in_view:.0%} of its box was left in the picture" if watched.in_view < 0.9 else ""
        said.append(f"belie no longer followed {name} when it was attacked{share}")
    elif watched.reported and watched.label.alert is AlertType.OBSTACLE_HIDING:
        said.append(
            f"in {watched.reported} of the {watched.frames} attacked frames the box reported near it was taken for it "
            f"(overlap with where its pixels are, IoU, at least {watched.least_overlap:.2f})"
        )
    elif (
        watched.reported
        and not watched.misnamed
        and watched.label.alert is AlertType.OBJECT_MISCLASSIFICATION
    ):
        called = " and ".join(sorted(watched.called))
        if watched.other_ids:
            ids = " and ".join(sorted(watched.other_ids))
            said.append(f"its box was told under the track id {ids}, which was taken for a new name of it")
        else:
            said.append(f"it was called {called}, which counts as one kind of thing with {watched.kind}")
    if 0 < watched.followed < watched.frames:
        said.append(f"belie followed it in {watched.followed} of the {watched.frames} attacked frames")
    if watched.peak > 0.0:
        said.append(f"the evidence came to {watched.peak:.0%} of what an alarm takes")
    # The check says why a box tells nothing only where no other box tells anything.
    is_invented = watched.label.alert is AlertType.OBSTACLE_INJECTION
    given = [] if is_invented and watched.unproven else watched.reasons.counted().most_common(1)
    for reason, frames in given:
        told = f"{name} is {reason.removeprefix(_IT)}" if reason.startswith(_IT) else reason
        said.append(f"in {frames} of {watched.frames} frames the check said: {told}")
    # That a hidden object is missing is said with the reason; that another name is doubted is not.
    if not given or watched.label.alert is AlertType.OBJECT_MISCLASSIFICATION:
        for reason, frames in watched.unproven.most_common(1):
            lacking = "be told from what is behind it" if is_invented else "vouch for it"
            said.append(f"in {frames} of {watched.frames} frames its pixels could not {lacking}: {reason}")
    return "; ".join(said) or "nothing tells"
