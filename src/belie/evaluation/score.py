"""Verdicts against labels: what was caught, how fast, and what was accused wrongly."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from belie.attacks import AttackLabel
from belie.evaluation.intervals import poisson_upper, wilson_interval
from belie.types import Alert, AlertType, Verdict

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
# What may be said of an attack besides its label's own alert: a box in the wrong place hides its object where that is,
# and invents one where it is not.
ALSO_RIGHT: dict[str, tuple[AlertType, ...]] = {
    "detections-shift": (AlertType.OBSTACLE_INJECTION,),
    "detections-shrink": (AlertType.OBSTACLE_INJECTION,),
    "detections-delay": (AlertType.OBSTACLE_INJECTION,),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RaisedAlert:
    """An alert and the frame in which it was raised."""

    frame: int
    stamp_ns: int
    alert: Alert

    def to_json(self) -> dict[str, Any]:
        """Frame and stamp, then the alert as in the verdict."""
        return {"frame": self.frame, "stamp_ns": self.stamp_ns, **self.alert.to_json()}


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelScore:
    """What became of one attack.

    Parameters
    ----------
    label : AttackLabel
        The attack.
    hit : RaisedAlert or None
        The first alert of the right type on the right source and, where both name one, object; None is a miss.
    delay_frames, delay_ms : int or None, float or None
        From the first message that lies (the label's ``onset_ns``; an attacked object may first be told of long after
        the attack begins) to the frame of the alert: in frames checked, 0 is the one stamped nearest to that message,
        and to the stamp of the frame. Neither is below zero, though the message may be stamped after the frame whose
        claims it completes.
    """

    label: AttackLabel
    hit: RaisedAlert | None = None
    delay_frames: int | None = None
    delay_ms: float | None = None

    def to_json(self) -> dict[str, Any]:
        """A JSON object."""
        return {
            "attack": self.label.text,
            "alert": self.label.alert.value,
            "sources": list(self.label.sources),
            "object": self.label.object,
            "other": self.label.other,
            "onset_ns": self.label.onset_ns,
            "hit": None if self.hit is None else self.hit.to_json(),
            "delay_frames": self.delay_frames,
            "delay_ms": self.delay_ms,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What a run, or several runs, came to.

    Parameters
    ----------
    labels : tuple of LabelScore
        One an attack, hit or missed.
    wrong_attributions : tuple of RaisedAlert
        Raised within the span of an attack, but of a type or on a source that no attack there explains.
    false_alerts : tuple of RaisedAlert
        Raised outside every span (grace included), or within, but on an object that is none of those attacked.
    before_onset : tuple of RaisedAlert
        The false alerts that came before the first attack of their run; none where nothing was attacked.
    aftermath : tuple of RaisedAlert
        Raised after an attack, about honest frames: false alerts that came later than its end, and others within its
        grace that no attack's hit is and whose estimated onset is not before its end. A late alert about the attack
        itself is none.
    honest_s : float
        Time checked outside every span (grace included).
    confidence : float
        Of the intervals.
    """

    labels: tuple[LabelScore, ...] = ()
    wrong_attributions: tuple[RaisedAlert, ...] = ()
    false_alerts: tuple[RaisedAlert, ...] = ()
    before_onset: tuple[RaisedAlert, ...] = ()
    aftermath: tuple[RaisedAlert, ...] = ()
    honest_s: float = 0.0
    confidence: float = 0.95

    @property
    def hits(self) -> int:
        """How many attacks were caught."""
        return sum(scored.hit is not None for scored in self.labels)

    @property
    def success_rate(self) -> float | None:
        """Share of the attacks caught; None where nothing was attacked."""
        return self.hits / len(self.labels) if self.labels else None

    @property
    def success_interval(self) -> tuple[float, float] | None:
        """Wilson's interval of the success rate."""
        return wilson_interval(self.hits, len(self.labels), self.confidence)

    @property
    def false_alerts_per_hour(self) -> float | None:
        """Rate of false alerts; None without honest time."""
        return len(self.false_alerts) / self.honest_s * 3600.0 if self.honest_s > 0.0 else None

    @property
    def false_alerts_per_hour_upper(self) -> float | None:
        """Upper bound of that rate: a short run without a false alert proves little."""
        if self.honest_s <= 0.0:
            return None
        return poisson_upper(len(self.false_alerts), self.confidence) / self.honest_s * 3600.0

    def success_within(self, frames: int) -> float | None:
        """Share of the attacks caught at most `frames` frames after the first that lies."""
        if not self.labels:
            return None
        delays = [scored.delay_frames for scored in self.labels if scored.delay_frames is not None]
        return sum(delay <= frames for delay in delays) / len(self.labels)

    def by_type(self) -> dict[AlertType, Score]:
        """The score of each type of alert that an attack called for, or that was raised falsely.

        >>> Score().by_type()
        {}
        """
        types = {scored.label.alert for scored in self.labels}
        types |= {
            raised.alert.type for raised in (*self.false_alerts, *self.wrong_attributions, *self.aftermath)
        }
        return {
            type: replace(
                self,
                labels=tuple(scored for scored in self.labels if scored.label.alert == type),
                wrong_attributions=_of_type(self.wrong_attributions, type),
                false_alerts=_of_type(self.false_alerts, type),
                before_onset=_of_type(self.before_onset, type),
                aftermath=_of_type(self.aftermath, type),
            )
            for type in AlertType
            if type in types
        }

    def to_json(self) -> dict[str, Any]:
        """A JSON object."""
        interval = self.success_interval
        return {
            "attacks": len(self.labels),
            "hits": self.hits,
            "success_rate": self.success_rate,
            "success_interval": None if interval is None else list(interval),
            "honest_s": self.honest_s,
            "false_alerts_per_hour": self.false_alerts_per_hour,
            "false_alerts_per_hour_upper": self.false_alerts_per_hour_upper,
            "confidence": self.confidence,
            "by_type": {
                type.value: {
                    "attacks": len(part.labels),
                    "hits": part.hits,
                    "success_rate": part.success_rate,
                    "false_alerts": len(part.false_alerts),
                    "wrong_attributions": len(part.wrong_attributions),
                }
                for type, part in self.by_type().items()
            },
            "labels": [scored.to_json() for scored in self.labels],
            "wrong_attributions": [raised.to_json() for raised in self.wrong_attributions],
            "false_alerts": [raised.to_json() for raised in self.false_alerts],
            "before_onset": [raised.to_json() for raised in self.before_onset],
            "aftermath": [raised.to_json() for raised in self.aftermath],
        }


def score(
    verdicts: Iterable[Verdict],
    labels: Iterable[AttackLabel],
    *,
    grace_s: float = 1.0,
    confidence: float = 0.95,
) -> Score:
    """Score one run of a detector.

    An alert belongs to an attack if the frame that raised it is stamped within the attack's span, from the
    stamp of its first frame to its end and `grace_s` more. An alert raised before that is never a hit. Where both the
    alert and the attack name an object, it must be the same; where the detector gives no ids, belie numbers the objects
    itself, and any will do. `ALSO_RIGHT` lists the types that are accepted besides the label's own.

    Parameters
    ----------
    verdicts : iterable of Verdict
        In the order in which they were given.
    labels : iterable of AttackLabel
        What was attacked; spans may overlap, and one alert may be the hit of several.
    grace_s : float
        How long after its end an attack may still be reported, seconds.

    Examples
    --------
    >>> from belie.types import AlertType, Status
    >>> label = AttackLabel(name="camera-black", text="camera-black", stream="camera", sources=("/image",),
    ...     alert=AlertType.CAMERA_FAULT, start_frame=1, stop_frame=3, start_ns=100_000_000,
    ...     onset_ns=100_000_000, end_ns=300_000_000, seed=0)
    >>> alert = Alert(type=AlertType.CAMERA_FAULT, source="/image", onset_ns=100_000_000)
    >>> run = [Verdict(frame=k, stamp_ns=k * 100_000_000, status=Status.CONSISTENT, latency_ms=1.0,
    ...                alerts=(alert,) if k == 2 else ()) for k in range(5)]
    >>> result = score(run, [label])
    >>> result.hits, result.labels[0].delay_frames, result.labels[0].delay_ms
    (1, 1, 100.0)
    """
    if grace_s < 0.0:
        raise ValueError(f"grace_s must not be negative, got {grace_s}")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie between 0 and 1, got {confidence}")
    run = [(verdict.frame, verdict.stamp_ns, verdict.alerts) for verdict in verdicts]
    truth = list(labels)
    stamps_ns = [stamp_ns for _, stamp_ns, _ in run]
    raised = [
        RaisedAlert(frame=frame, stamp_ns=stamp_ns, alert=alert)
        for frame, stamp_ns, alerts in run
        for alert in alerts
    ]
    grace_ns = round(grace_s * NS_PER_S)
    spans = [(label.start_ns, label.end_ns + grace_ns) for label in truth]

    false_alerts, wrong = [], []
    for one in raised:
        around = [
            label for label, (start, end) in zip(truth, spans, strict=True) if start <= one.stamp_ns <= end
        ]
        if not around or _is_of_another_object(around, one.alert):
            false_alerts.append(one)
        elif not any(_explains(label, one.alert) for label in around):
            wrong.append(one)
    first_start_ns = min((start for start, _ in spans), default=None)
    scored = tuple(
        _label_score(label, span, raised, stamps_ns) for label, span in zip(truth, spans, strict=True)
    )
    hits = [each.hit for each in scored]
    return Score(
        labels=scored,
        wrong_attributions=tuple(wrong),
        false_alerts=tuple(false_alerts),
        before_onset=tuple(
            one for one in false_alerts if first_start_ns is not None and one.stamp_ns < first_start_ns
        ),
        aftermath=tuple(
            one
            for one in raised
            if one not in hits and _is_aftermath(one, truth, is_false=one in false_alerts)
        ),
        honest_s=_honest_s(stamps_ns, spans),
        confidence=confidence,
    )


def pool_scores(scores: Iterable[Score]) -> Score:
    """One score for several runs: attacks, alerts and honest time are put together.

    >>> pool_scores([Score(honest_s=1800.0), Score(honest_s=1800.0)]).honest_s
    3600.0
    """
    every = list(scores)
    if len({one.confidence for one in every}) > 1:
        raise ValueError("scores of different confidence cannot be pooled")
    return Score(
        labels=tuple(scored for one in every for scored in one.labels),
        wrong_attributions=tuple(raised for one in every for raised in one.wrong_attributions),
        false_alerts=tuple(raised for one in every for raised in one.false_alerts),
        before_onset=tuple(raised for one in every for raised in one.before_onset),
        aftermath=tuple(raised for one in every for raised in one.aftermath),
        honest_s=math.fsum(one.honest_s for one in every),
        confidence=every[0].confidence if every else 0.95,
    )


def _is_aftermath(one: RaisedAlert, labels: Iterable[AttackLabel], *, is_false: bool) -> bool:
    """Whether an alert that is no hit was raised when an attack was over, and is not about that attack."""
    begun = [label for label in labels if label.start_ns <= one.stamp_ns]
    if not begun or any(one.stamp_ns < label.end_ns for label in begun):
        return False
    return is_false or one.alert.onset_ns >= max(label.end_ns for label in begun)


def _explains(label: AttackLabel, alert: Alert) -> bool:
    is_right_type = alert.type in (label.alert, *ALSO_RIGHT.get(label.name, ()))
    # Of an object, what began when the attack was over is its aftermath: the true name that comes back is no lie.
    is_about_it = label.stream != "detections" or alert.onset_ns < label.end_ns
    return is_right_type and is_about_it and alert.source in label.sources and _may_mean(label, alert)


def _may_mean(label: AttackLabel, alert: Alert) -> bool:
    """Whether an alert does not name another object than the one that was attacked."""
    return label.object is None or alert.object is None or alert.object in (label.object, label.other)


def _is_of_another_object(around: Iterable[AttackLabel], alert: Alert) -> bool:
    """Whether an alert within attacks on objects names none of theirs."""
    on_objects = [label for label in around if label.stream == "detections"]
    return alert.object is not None and bool(on_objects) and not any(_may_mean(o, alert) for o in on_objects)


def _of_type(several: Iterable[RaisedAlert], type: AlertType) -> tuple[RaisedAlert, ...]:
    return tuple(raised for raised in several if raised.alert.type == type)


def _label_score(
    label: AttackLabel, span: tuple[int, int], raised: Sequence[RaisedAlert], stamps_ns: Sequence[int]
) -> LabelScore:
    start_ns, end_ns = span
    hit = next(
        (one for one in raised if start_ns <= one.stamp_ns <= end_ns and _explains(label, one.alert)), None
    )
    if hit is None:
        return LabelScore(label=label)
    return LabelScore(
        label=label,
        hit=hit,
        delay_frames=max(0, stamps_ns.index(hit.stamp_ns) - nearest_frame(stamps_ns, label.onset_ns)),
        delay_ms=max(0, hit.stamp_ns - label.onset_ns) / NS_PER_MS,
    )


def nearest_frame(stamps_ns: Sequence[int], stamp_ns: int) -> int:
    """Index of the frame that is stamped nearest.

    >>> nearest_frame([0, 100, 200], 160)
    2
    """
    return min(range(len(stamps_ns)), key=lambda k: abs(stamps_ns[k] - stamp_ns))


def _honest_s(stamps_ns: Sequence[int], spans: Sequence[tuple[int, int]]) -> float:
    """Time from the first to the last verdict outside the union of the spans."""
    if not stamps_ns:
        return 0.0
    first, last = min(stamps_ns), max(stamps_ns)
    honest_ns, free_from = 0, first
    for start, end in sorted(spans):
        honest_ns += max(0, min(start, last) - free_from)
        free_from = max(free_from, end)
    return (honest_ns + max(0, last - free_from)) / NS_PER_S
