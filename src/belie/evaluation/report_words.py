"""What the report says in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from belie.attacks import AttackLabel
from belie.detector.alerts import ALERT_OF_CHECK
from belie.evaluation.run import Run
from belie.evaluation.score import RaisedAlert
from belie.evaluation.snapshots import Snapshot
from belie.evaluation.trace import CheckTrace
from belie.evaluation.traced_alert import TracedAlert
from belie.geometry import FloatArray
from belie.geometry.boxes import where_px
from belie.types import AlertType, Status

_ACCUSATIONS = {
    AlertType.ODOMETRY_SPOOFING: "the stream {source} claims a motion that the camera did not see",
    AlertType.POSITION_SPOOFING: "the stream {source} claims positions that do not fit the motion seen",
    AlertType.CAMERA_FAULT: "the camera {source} does not show the world as it is",
    AlertType.OBSTACLE_HIDING: "{source} no longer reports {object}, which is still in the image",
    AlertType.OBJECT_MISCLASSIFICATION: "{source} reports {object} as what it is not",
    AlertType.OBSTACLE_INJECTION: "{source} reports {object}, which the image does not show",
}
_LIES = {
    AlertType.ODOMETRY_SPOOFING: "false motion",
    AlertType.POSITION_SPOOFING: "false positions",
    AlertType.CAMERA_FAULT: "faults",
    AlertType.OBSTACLE_HIDING: "hidden obstacles",
    AlertType.OBJECT_MISCLASSIFICATION: "misclassified objects",
    AlertType.OBSTACLE_INJECTION: "invented obstacles",
}
_TYPE_NAMES = {
    AlertType.ODOMETRY_SPOOFING: "false motion (odometry or IMU)",
    AlertType.POSITION_SPOOFING: "false position (GNSS or localisation)",
    AlertType.CAMERA_FAULT: "camera at fault",
    AlertType.OBSTACLE_HIDING: "hidden obstacle",
    AlertType.OBJECT_MISCLASSIFICATION: "misclassified object",
    AlertType.OBSTACLE_INJECTION: "invented obstacle",
}


def accusation(alert_type: AlertType, source: str, object: str | None = None) -> str:
    """What an alert says, as a clause; `object`: the one that it names.

    >>> accusation(AlertType.CAMERA_FAULT, "/image")
    'the camera /image does not show the world as it is'
    >>> accusation(AlertType.OBSTACLE_HIDING, "/detections", "car 7")
    '/detections no longer reports car 7, which is still in the image'
    """
    return _ACCUSATIONS[alert_type].format(source=source, object=object or "an object")


def type_name(alert_type: AlertType) -> str:
    """An alert type in words.

    >>> type_name(AlertType.CAMERA_FAULT)
    'camera at fault'
    """
    return _TYPE_NAMES[alert_type]


def raised_words(raised: RaisedAlert) -> str:
    """An alert by its frame, in a few words.

    >>> from belie.types import Alert
    >>> alert = Alert(type=AlertType.OBSTACLE_HIDING, source="/d", onset_ns=0, object="7")
    >>> raised_words(RaisedAlert(frame=29, stamp_ns=9, alert=alert))
    'frame 29: obstacle_hiding of object 7 by /d'
    """
    alert = raised.alert
    about = "" if alert.object is None else f" of object {alert.object}"
    return f"frame {raised.frame}: {alert.type.value}{about} by {alert.source}"


def attacked_words(label: AttackLabel, kinds: Mapping[AttackLabel, str] | None = None) -> str:
    """The objects that a label names: both of a swap; empty where it names none. `kinds`: what the first one is.

    >>> from dataclasses import replace
    >>> label = AttackLabel(name="detections-swap", text="detections-swap", stream="detections", sources=("/d",),
    ...     alert="object_misclassification", start_frame=1, stop_frame=2, start_ns=5, onset_ns=5, end_ns=6, seed=0,
    ...     object="7", other="3")
    >>> attacked_words(label), attacked_words(replace(label, other=None), {replace(label, other=None): "car"})
    ('objects 7 and 3', 'car 7')
    """
    return label.about((kinds or {}).get(label, ""))


def headline(run: Run) -> str:
    """The verdict in one sentence."""
    if run.alerts:
        first = run.alerts[0]
        start_s = run.trace.since_start_s([first.raised.alert.onset_ns])[0]
        said = accusation(first.raised.alert.type, first.raised.alert.source, first.object)
        if other := _swapped_with(run, first):
            said = f"{first.raised.alert.source} gives {first.object} another's track id, {other}"
        others = len(run.alerts) - 1
        more = "" if not others else f", and {others} more alert{'s' if others > 1 else ''}"
        return f"{said[0].upper()}{said[1:]}: from about {start_s:.1f} s on{more}."
    if not run.has_claims:
        return "No stream made a claim: there was nothing to check but the camera itself."
    undecided = run.trace.share(Status.UNDECIDED)
    if undecided > 0.9:
        return "No claim was contradicted, but almost nothing could be judged."
    if undecided > 0.5:
        return "No claim was contradicted, but more than half of the recording could not be judged."
    open_questions = [_question(check) for check in run.trace.checks if check.never_decided]
    open_questions += [f"the objects of {told.source}" for told in run.told if told.is_unchecked]
    if open_questions:
        return f"No claim was contradicted, but not everything was checked: nothing is known of {_and(open_questions)}."
    return "No claim was contradicted: what the robot said agrees with what its camera saw."


def _swapped_with(run: Run, traced: TracedAlert) -> str:
    """The track id of another object that an accused one is called by; empty where it is not."""
    key = (traced.raised.alert, traced.raised.stamp_ns)
    return next((f.told_id for f in run.films if f.is_swapped and (f.alert, f.raised_ns) == key), "")


def never_decided(run: Run) -> list[str]:
    """Of each check that was undecided whenever it ran: what stays unknown, and why; a clause each."""
    return [
        f"{_question(check)}: undecided in all {check.frames_run} frames{_mostly(check)}"
        for check in run.trace.checks
        if check.never_decided
    ]


def _question(check: CheckTrace) -> str:
    kind = ALERT_OF_CHECK.get(check.check)
    return (
        f"{check.check} of {check.source}"
        if kind is None
        else f"{_LIES[kind]} of {check.source} ({check.check})"
    )


def _mostly(check: CheckTrace) -> str:
    (reason, frames), *others = check.undecided.most_common()
    return f", in {frames} of them because: {reason}" if others else f" because: {reason}"


def _and(parts: Sequence[str]) -> str:
    return ", ".join(parts[:-1]) + " and " * (len(parts) > 1) + parts[-1]


def tone(run: Run) -> str:
    """How the headline is to be taken: "bad", "open" where too little was checked to say, or "good"."""
    if run.alerts:
        return "bad"
    is_open = not run.has_claims or run.trace.share(Status.UNDECIDED) > 0.5
    is_open = is_open or any(told.is_unchecked for told in run.told)
    return "open" if is_open or any(check.never_decided for check in run.trace.checks) else "good"


def summary(run: Run) -> str:
    """The numbers behind the headline, in one sentence."""
    shares = {status: run.trace.share(status) for status in Status}
    return (
        f"{len(run.trace)} frames over {run.trace.seconds[-1]:.1f} s: "
        f"{shares[Status.CONSISTENT]:.0%} consistent, {shares[Status.CONTRADICTED]:.0%} contradicted, "
        f"{shares[Status.UNDECIDED]:.0%} undecided."
    )


def alert_row(run: Run, traced: TracedAlert) -> dict[str, str]:
    """One alert, for the table."""
    raised, alert = traced.raised, traced.raised.alert
    onset_s, raised_s, end_s = run.trace.since_start_s([alert.onset_ns, raised.stamp_ns, traced.end_ns])
    other = _swapped_with(run, traced)
    ends_with_run = traced.end_ns >= int(run.trace.stamps_ns[-1])
    return {
        "type": type_name(alert.type),
        "identifier": alert.type.value,
        "source": alert.source,
        "object": (traced.object or "") + (f", called id {other}" if other else ""),
        "onset": f"{onset_s:.2f} s (frame {run.trace.frame_at(alert.onset_ns)})",
        "raised": f"{raised_s:.2f} s (frame {raised.frame})",
        "delay": f"{traced.delay_ns * 1e-9:.2f} s",
        "end": "still on at the end" if ends_with_run else f"{end_s:.2f} s",
        "reason": traced.reason,
    }


def snapshot_title(run: Run, snapshot: Snapshot) -> str:
    """Which frame this is, and why it is shown."""
    second = run.trace.since_start_s([snapshot.stamp_ns])[0]
    where = f"Frame {snapshot.number}, {second:.2f} s"
    found = snapshot.object
    if snapshot.alert is None:
        return f"{where}: the frame that came nearest to an alert"
    named = "" if found is None else f", {found.label} {found.name}"
    return f"{where}: {type_name(snapshot.alert.type)}{named}, {snapshot.alert.source}"


def snapshot_words(run: Run, snapshot: Snapshot) -> str:
    """What the corners of this picture show."""
    if snapshot.basis == "object":
        return _object_words(snapshot)
    if math.isnan(snapshot.displacement_px):
        return "No corners could be drawn in this frame."
    apart = f"They lie {snapshot.displacement_px:.1f} px apart (median, in the full image)."
    if snapshot.basis == "prediction":
        basis = (
            "the map that was built from the claims predicts them"
            if run.profile == "paper"
            else "they were predicted from the motion so far"
        )
        return f"Filled: where corners of the scene are. Hollow: where {basis}. {apart}"
    since_s = (snapshot.stamp_ns - snapshot.since_ns) * 1e-9
    words = (
        "Filled: where corners of the scene are. Hollow: where they would have to be if the odometry's claim "
        f"of the last {since_s:.1f} s was true. {apart}"
    )
    if snapshot.displacement_px < 2.0:
        if snapshot.alert is not None and snapshot.alert.type is AlertType.POSITION_SPOOFING:
            words += " The odometry agrees with the camera; it is the position that does not."
        elif snapshot.alert is not None and snapshot.alert.type is AlertType.ODOMETRY_SPOOFING:
            words += " Over so short a time the lie is small; it was found because it went on and on."
    return words


def _object_words(snapshot: Snapshot) -> str:
    found = snapshot.object
    if found is None:
        return "The accused object is not followed in this frame."
    name = f"{found.label} {found.name}"
    called = f"{found.told_label} {snapshot.told_id}".rstrip()
    told = f"Solid box: where the detector reports {called}. " if found.detected_px is not None else ""
    if snapshot.alert is not None and snapshot.alert.type is AlertType.OBSTACLE_INJECTION:
        return (
            f"{told}Its dots are corners of what is behind the box. The dashed box is carried along by them."
        )
    if snapshot.elsewhere_px is not None:
        told += f"Red, {way(found.box_px, snapshot.elsewhere_px)} of it: where the detector reports {name}. "
    apart = (
        ""
        if math.isnan(snapshot.displacement_px)
        else f" Its corners lie {snapshot.displacement_px:.1f} px (median, full image) from where it was expected."
    )
    missing = " The detector reports nothing there." if found.status == "missing" else ""
    return f"Dashed box: {name} by its own pixels, {where_px(found.box_px)}.{missing} {told.rstrip()}{apart}"


def way(from_px: FloatArray, to_px: FloatArray) -> str:
    """How far, and which way, the middle of one box lies from that of another.

    >>> way(np.array([0.0, 0.0, 10.0, 10.0]), np.array([20.0, 1.0, 30.0, 11.0]))
    '20 px right'
    """
    right, down = (0.5 * (to_px[:2] + to_px[2:] - from_px[:2] - from_px[2:])).tolist()
    if abs(right) >= abs(down):
        return f"{abs(right):.0f} px {'right' if right > 0 else 'left'}"
    return f"{abs(down):.0f} px {'below' if down > 0 else 'above'}"


def unfollowed(run: Run, label: AttackLabel) -> str:
    """Why there is no picture of an attacked object; empty where there is one, or no object."""
    if label.stream != "detections" or any(film.attack == label for film in run.attacked):
        return ""
    if run.profile == "paper":
        return "this profile keeps none of objects"
    if label.object is None:
        return f"its label names no object (all were attacked, or the detector gives no track ids){_doubt(run, label)}"
    return f"belie did not follow object {label.object}: it knows none that it was never told of"


def _doubt(run: Run, label: AttackLabel) -> str:
    """What the check that should have seen a lie most often said in the whole run while it was undecided."""
    for check in run.trace.checks:
        if ALERT_OF_CHECK.get(check.check) is label.alert and check.source in label.sources:
            for reason, frames in check.undecided.most_common(1):
                return f"; in {frames} frames of the whole run the check said: {reason}"
    return ""


def why_missed(run: Run, label: AttackLabel) -> str:
    """Why an attack on an object raised no alert, as far as can be told; empty for other attacks."""
    return next((film.why for film in run.attacked if film.attack == label), unfollowed(run, label))


def floor_rows(run: Run) -> list[dict[str, str]]:
    """Minimum detectable lie by check and unit: at its best, usually, at its worst."""
    rows = []
    for check in run.trace.checks:
        for unit, values in check.floors.items():
            finite = values[np.isfinite(values)]
            if len(finite):
                best, usual, worst = np.percentile(finite, (5, 50, 95))
                rows.append(
                    {
                        "check": f"{check.check} {check.source}",
                        "usual": f"{usual:.2g} {unit}",
                        "best": f"{best:.2g} {unit}",
                        "worst": f"{worst:.2g} {unit}",
                    }
                )
    return rows


def latency_words(run: Run) -> str:
    """How long an update took."""
    p50, p95, slowest = np.percentile(run.trace.latency_ms, (50, 95, 100))
    decode = float(np.median(run.trace.decode_ms))
    return (
        f"One update took {p50:.1f} ms (median), {p95:.1f} ms (95 % were faster), {slowest:.1f} ms at most. "
        f"Decoding an image took {decode:.1f} ms (median) beside that."
    )


def mishap_rows(run: Run) -> Sequence[tuple[str, str]]:
    """What the joining of the streams met: kind, and how often on which stream."""
    return [
        (kind.replace("_", " "), ", ".join(f"{count} of {stream}" for stream, count in streams.items()))
        for kind, streams in run.join_counts.items()
    ]
