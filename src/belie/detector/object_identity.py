"""Which objects are kept, and what each is called: track ids are what a detector tells, so they may lie."""

from __future__ import annotations

from collections.abc import Sequence

from belie.checks.objects import ObjectSettings
from belie.detector.object_track import ObjectTrack
from belie.geometry import FloatArray
from belie.geometry.boxes import longer_side

FULL_VOTE = 2.0  # of a sure detection of a large object
_HALF_SIGHT_PX = 24.0  # side at which a label counts half
_NEARER = 1.5  # times the side of the smallest object: what takes its place where there are too many


def new_name(tracks: Sequence[ObjectTrack], track_id: str, number: int) -> str:
    """Of an object that was just met: its id, where no other bears it.

    >>> new_name([], "7", 3), new_name([], "", 3)
    ('7', '#3')
    """
    is_taken = not track_id or any(track.name == track_id for track in tracks)
    return f"#{number}" if is_taken else track_id


def call_by_ids(told: Sequence[ObjectTrack], missing: set[str]) -> None:
    """Call the objects of a message by their detector's ids; what is accused or missing keeps the name that it had."""
    for track in told:
        is_accused = track.naming.accused or track.hiding.accused or track.phantom.accused
        if track.track_id and not is_accused and track.track_id not in missing:
            track.name = track.track_id


def without_doubles(tracks: Sequence[ObjectTrack], told: Sequence[ObjectTrack]) -> list[ObjectTrack]:
    """The objects but for places that were met under an id that was another's, once that is back where it was before.

    Such a place was an error or a lie, and what is seen there is something else: nobody hides it. `tracks` in the order
    in which they were met; `told`: those of this message.
    """
    first: dict[str, ObjectTrack] = {}
    for track in tracks:
        if track.track_id:
            first.setdefault(track.track_id, track)
    here = {id(track) for track in told}

    def is_double(track: ObjectTrack) -> bool:
        bearer = first.get(track.track_id, track)
        return bearer is not track and id(bearer) in here and track.born_id == track.track_id

    return [track for track in tracks if id(track) in here or not is_double(track)]


def stand_ins(tracks: Sequence[ObjectTrack]) -> set[int]:
    """Numbers of the places that were met under the id of an object that is now accused of being hidden.

    The detector told of them in its stead: whatever is seen there, it was never claimed to be an object of its own.
    """
    hidden = {track.track_id: track.number for track in tracks if track.hiding.accused and track.track_id}
    return {track.number for track in tracks if hidden.get(track.born_id, track.number) < track.number}


def make_room(tracks: list[ObjectTrack], side_px: float, settings: ObjectSettings) -> bool:
    """Whether another object can be followed; the smallest unproven one may have to go for a much larger one."""
    if len(tracks) < settings.most_objects:
        return True
    # What is established stays: else one message full of boxes would make everything forgotten.
    unproven = (track for track in tracks if track.weight < settings.established)
    smallest = min(unproven, key=lambda track: longer_side(track.box_px), default=None)
    if smallest is None or _NEARER * longer_side(smallest.box_px) > side_px:
        return False
    tracks.remove(smallest)
    return True


def vote_of(score: float, box_px: FloatArray) -> float:
    """What a detection counts for its label: far objects are mixed up with what stands before them.

    >>> import numpy as np
    >>> large, small = np.array([0.0, 0.0, 60.0, 40.0]), np.array([0.0, 0.0, 24.0, 16.0])
    >>> round(vote_of(0.9, large), 2), round(vote_of(0.6, large), 2), round(vote_of(0.9, small), 2)
    (2.0, 1.0, 1.0)
    """
    sure = min(max((score - 0.3) / 0.6, 0.1), 1.0)
    return FULL_VOTE * sure * min(1.0, 0.5 * longer_side(box_px) / _HALF_SIGHT_PX)
