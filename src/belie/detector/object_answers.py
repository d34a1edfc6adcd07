"""What is said about the objects of a detector: one result a check, and one for every object that is lied about."""

from __future__ import annotations

from collections.abc import Sequence

from belie.checks.objects import ErrorTest, Habit
from belie.detector.alerts import Judgement
from belie.detector.object_stream import ObjectStream
from belie.detector.object_track import ObjectTrack
from belie.geometry.boxes import edges_px, where_px
from belie.types import AccusedObject, CheckResult, Status

_LONGEST_NS = 500_000_000  # without a message: the detector itself is silent
_SILENT = 5.0  # its usual intervals
_NONE_FOLLOWED = (
    "no object is followed, so none can be missed: what is hidden from the first image on cannot be seen"
)


def answer(stream: ObjectStream, frame_ns: int, size: tuple[int, int]) -> list[Judgement]:
    """One result a check, and one for every object that is lied about."""
    silent_ns = max(_LONGEST_NS, int(_SILENT * stream.interval_s * 1e9))
    if stream.last_ns is None or frame_ns - stream.last_ns > silent_ns:
        since = "yet" if stream.last_ns is None else f"for {(frame_ns - stream.last_ns) * 1e-9:.1f} s"
        return withhold(stream, f"no message {since}")
    if stream.unboxed and not stream.tracks:
        return withhold(
            stream,
            f"{stream.unboxed} detections tell neither an image box nor a size: nobody knows where to look",
        )
    return [*_hiding(stream, size), *_naming(stream), *_injection(stream)]


def withhold(stream: ObjectStream, reason: str) -> list[Judgement]:
    """UNDECIDED, for all checks."""
    return [
        Judgement(result=CheckResult(
            check=check, source=stream.source, status=Status.UNDECIDED, unit="llr", reason=reason))
        for check in ("hiding", "misclassification", "injection")
    ]  # fmt: skip


def _hiding(stream: ObjectStream, size: tuple[int, int]) -> list[Judgement]:
    floor = _floor(stream, stream.missed, "hiding")
    accused: list[Judgement] = []
    doubtful: list[str] = []
    explained: list[str] = []
    for track in stream.tracks:
        if track.hiding.accused:
            about = _accused(track, is_told=False)
            accused.append(Judgement(onset_ns=track.hiding.onset_ns, accused=about, result=CheckResult(
                check="hiding", source=stream.source, status=Status.CONTRADICTED,
                statistic=track.hiding.statistic, threshold=track.hiding.threshold, unit="llr", floor=floor,
                reason=f"{track.label} {track.name} {where_px(track.box_px)} is missing in "
                f"{_share(track.hiding)}, more than its detector is used to miss, but it is still there: "
                f"{_there(track)}", object=track.name)))  # fmt: skip
        elif track.last_seen_ns < (stream.last_ns or 0) and track.weight >= stream.settings.established:
            fair = track.absence(size, stream.settings)
            if not fair and len(track.covers) and not track.hiding.errors:
                fair = "covered by another detection, and never told of while it was"
            if not fair and track.hiding.is_open:
                doubtful.append(
                    f"{track.label} {track.name} is missing in {_share(track.hiding)}: what goes along its path, "
                    "before the background, does not tell whether it is the same"
                )
            if fair:
                # Where its pixels have told that it is not there to be seen, there is no doubt; but what was
                # accused a moment ago is not acquitted by what passes before it.
                undecided = fair.startswith(("too few", "fading")) or track.accused_ns is not None
                (doubtful if undecided else explained).append(
                    f"{track.label} {track.name} is missing: {fair}"
                )
    if accused:
        return accused
    worst, threshold = stream.shares.worst("hiding", stream.tracks)
    status = Status.UNDECIDED if doubtful else Status.CONSISTENT
    usual = f"{_objects(stream.tracks)}, none missing longer than usual" if stream.tracks else _NONE_FOLLOWED
    if stream.unfollowed:
        usual += f"; {stream.unfollowed} smaller ones are not followed (objects.most_objects)"
    reason = [*doubtful, *explained, usual][0]
    return [Judgement(result=CheckResult(
        check="hiding", source=stream.source, status=status, threshold=threshold, unit="llr", floor=floor,
        statistic=worst.hiding.statistic if worst else 0.0, reason=reason,
        object=worst.name if worst and worst.hiding.errors and not doubtful else None))]  # fmt: skip


def _naming(stream: ObjectStream) -> list[Judgement]:
    floor = _floor(stream, stream.misnamed, "misclassification")
    accused = [
        Judgement(onset_ns=track.naming.onset_ns, accused=_accused(track), result=CheckResult(
            check="misclassification", source=stream.source, status=Status.CONTRADICTED,
            statistic=track.naming.statistic, threshold=track.naming.threshold, unit="llr", floor=floor,
            reason=f"{track.label} {track.name} {where_px(track.box_px)} is called {track.called} in "
            f"{_share(track.naming)}, but its pixels are the same: {_there(track)}",
            object=track.name))
        for track in stream.tracks if track.naming.accused
    ]  # fmt: skip
    if accused:
        return accused
    worst, threshold = stream.shares.worst("misclassification", stream.tracks)
    kept = "keeps its name" if len(stream.tracks) == 1 else "keep their names"
    status, reason = Status.CONSISTENT, f"{_objects(stream.tracks)} {kept}"
    if worst is not None and worst.naming.is_open:
        status = Status.UNDECIDED
        reason = (
            f"{worst.label} {worst.name} is called {worst.called} in {_share(worst.naming)}: "
            "its pixels do not tell whether it is the same object"
        )
    return [Judgement(result=CheckResult(
        check="misclassification", source=stream.source, status=status, threshold=threshold,
        unit="llr", floor=floor, statistic=worst.naming.statistic if worst else 0.0, reason=reason,
        object=worst.name if worst and worst.naming.errors else None))]  # fmt: skip


def _injection(stream: ObjectStream) -> list[Judgement]:
    phantoms = [track for track in stream.tracks if track.phantom.accused and _was_told(track, stream)]
    accused = [
        Judgement(onset_ns=track.phantom.since_ns, accused=_accused(track, is_real=False), result=CheckResult(
            check="injection", source=stream.source, status=Status.CONTRADICTED, statistic=track.phantom.statistic,
            threshold=stream.shares.threshold("injection", track), unit="llr", object=track.track_id or track.name,
            reason=f"{track.label} {track.track_id or track.name} {where_px(track.box_px)}: nothing stands there; the "
            "corners in its box lie on the ground or the wall behind it"))
        for track in phantoms if track.last_seen_ns == stream.last_ns
    ]  # fmt: skip
    # Who does not tell of it does not lie; but a few such messages do not end a lie that flickers.
    accused += [
        Judgement(result=CheckResult(
            check="injection", source=stream.source, status=Status.UNDECIDED, statistic=track.phantom.statistic,
            threshold=stream.shares.threshold("injection", track), unit="llr", object=track.track_id or track.name,
            reason=f"{track.label} {track.track_id or track.name}, where nothing stood, is not told of at the moment"))
        for track in phantoms if track.last_seen_ns != stream.last_ns
    ]  # fmt: skip
    if accused:
        return accused
    told = [track for track in stream.tracks if track.last_seen_ns == stream.last_ns]
    unseen = [track for track in told if track.phantom.why]
    worst, threshold = stream.shares.worst("injection", told)
    status = Status.UNDECIDED if unseen and len(unseen) == len(told) else Status.CONSISTENT
    reason = f"boxes with something of their own in them: {len(told) - len(unseen)} of {len(told)}"
    if status is Status.UNDECIDED:
        reason = f"no box can be told from what is behind it: {unseen[0].phantom.why}"
    return [Judgement(result=CheckResult(
        check="injection", source=stream.source, status=status, threshold=threshold, unit="llr",
        statistic=worst.phantom.statistic if worst else 0.0, reason=reason))]  # fmt: skip


def _accused(track: ObjectTrack, *, is_real: bool = True, is_told: bool = True) -> AccusedObject:
    """What an alert tells of an object; `is_real`: it is one, `is_told`: its detector says that it is."""
    return AccusedObject(
        label_before=track.label if is_real else None,
        label_after=track.told_label if is_told else None,
        id_after=track.told_id or None if is_told else None,
        box_px=edges_px(track.box_px),
    )


def _was_told(track: ObjectTrack, stream: ObjectStream) -> bool:
    """Whether the detector told of it lately."""
    return (stream.last_ns or 0) - track.last_seen_ns <= _SILENT * stream.interval_s * 1e9


def _floor(stream: ObjectStream, habit: Habit, check: str) -> str | None:
    """Shortest run that would be accused, of the largest object."""
    if not stream.interval_s:
        return None
    largest = stream.shares.largest(stream.tracks)
    messages = habit.shortest_run(stream.interval_s, stream.shares.threshold(check, largest))
    return f"{messages * stream.interval_s:.1f} s"


def _objects(tracks: Sequence[ObjectTrack]) -> str:
    return "1 object" if len(tracks) == 1 else f"{len(tracks)} objects"


def _share(test: ErrorTest) -> str:
    return f"{test.errors} of the last {test.messages} messages"


def _there(track: ObjectTrack) -> str:
    error = track.motion.error_px2 if track.motion is not None else None
    fit = "" if error is None else f", within {error:.2g} px² (e^L)"
    figure, likeness = track.looks.figure, track.looks.picture
    if track.is_soft and figure.vouches:
        return (
            "what it differs in from the background is the same "
            f"(correlation {figure.score:.2f}, {figure.beside:.2f} beside it)"
        )
    if track.is_soft and likeness.evidence > 0.0:
        return f"its picture is the same (correlation {likeness.score:.2f}, {likeness.beside:.2f} beside it)"
    return f"{track.proven} corners on it still move together{fit}"
