"""What is known of one object after a frame: for reports and viewers, to look at and not to change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from belie.detector.object_track import ObjectTrack
from belie.geometry import FloatArray

ObjectStatus = Literal["reported", "missing", "not told"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObjectView:
    """One object at one frame.

    Parameters
    ----------
    source, name, label : str
        The detector, the object's track id, and the last label that fits what most messages called it.
    number : int
        Its own for as long as its pixels are followed, whatever its detector calls it.
    met_ns : int
        Stamp of the message that first told of it.
    told_label, told_id : str
        What the detector last called it, and its track id in the message of this frame, if that tells of it.
    misnamed : bool
        Whether that does not fit.
    is_established : bool
        Whether it was told of often and surely enough that its absence, or another name, means anything.
    is_swapped : bool
        Whether it is misnamed by bearing another object's track id.
    unseen : str
        Why nothing can be told of whether anything stands in its box; empty where it can be.
    box_px : array (4,)
        Where its own pixels say that it is: left, top, right, bottom edge.
    detected_px : array (4,) or None
        Where the detector says that it is, by a message that was heard at this frame.
    told_ns : int
        Stamp of the last message that speaks of it: earlier than the frame's if messages come late.
    predicted_px, observed_px : array (N, 2)
        Its corners: where constant velocity expected them, equations (4) and (5), and where they were found.
    error_px2 : float or None
        ``e^L``, how far its corners are from moving as one, image px²; None where too few do.
    status : "reported", "missing" or "not told"
        In the message heard at this frame; or "not told" where none was heard.
    """

    source: str
    name: str
    label: str
    told_label: str
    misnamed: bool
    box_px: FloatArray
    detected_px: FloatArray | None
    told_ns: int
    predicted_px: FloatArray
    observed_px: FloatArray
    error_px2: float | None
    status: ObjectStatus
    number: int = 0
    met_ns: int = 0
    told_id: str = ""
    is_established: bool = False
    is_swapped: bool = False
    unseen: str = ""


def view_of(track: ObjectTrack, source: str, *, heard: bool, is_established: bool) -> ObjectView:
    """The view of a track; `heard`: whether a message of its detector was judged at this frame."""
    motion = track.motion
    none = np.empty((0, 2))
    return ObjectView(
        source=source,
        name=track.name,
        label=track.label,
        told_label=track.told_label,
        misnamed=bool(track.called),
        box_px=_own(track.box_px if motion is None else motion.box_px),
        detected_px=None if track.told_px is None else _own(track.told_px),
        told_ns=track.last_seen_ns,
        predicted_px=_own(none if motion is None else motion.predicted_px[motion.agreeing]),
        observed_px=_own(none if motion is None else motion.found_px[motion.agreeing]),
        error_px2=None if motion is None else motion.error_px2,
        status="reported" if track.told_px is not None else "missing" if heard else "not told",
        number=track.number,
        met_ns=track.met_ns,
        told_id="" if track.told_px is None else track.told_id,
        is_established=is_established,
        is_swapped=bool(track.called) and track.is_swapped,
        unseen=track.phantom.why,
    )


def _own(px: FloatArray) -> FloatArray:
    """A read-only copy: who looks at an object must not move it."""
    copy = px.copy()
    copy.flags.writeable = False
    return copy
