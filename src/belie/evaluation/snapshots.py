"""The pictures of a run: the frames at the alerts, with the corners that prove it. All others are let go."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

from belie.evaluation.expected_corners import View, corners_under_claim
from belie.evaluation.film import OBJECT_ALERTS
from belie.evaluation.followed import FollowedObject, accused, elsewhere_px
from belie.geometry import FloatArray
from belie.types import Alert, GrayImage, MountedCamera, Verdict, VisualEstimate

if TYPE_CHECKING:
    from belie.detector.object_view import ObjectView

Basis = Literal["claim", "prediction", "object"]

_RING_FRAMES = 10  # 20 MB at 1080p
_MOST_ALERTS = 6
_MOST_CORNERS = 220
_PICTURE_WIDTH_PX = 1000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """One frame, downscaled, with its corners.

    Parameters
    ----------
    number, stamp_ns : int
        The frame's.
    alert : Alert or None
        The alert that was raised in this frame; None for the frame that came nearest to one.
    image : array (h, w), uint8
        The picture.
    observed_px, expected_px : array (N, 2)
        Where each corner is, and where it was expected, pixels of `image`.
    basis : "claim", "prediction" or "object"
        Expected if the claim was true; predicted by equations (4) and (5); or of the accused object, by its motion.
    since_ns : int
        The claimed motion is that since this stamp.
    displacement_px : float
        Median distance between the two, pixels of the camera's image; NaN without corners.
    object : ObjectView or None
        The accused object, in pixels of the camera's image, where the alert names one that is followed.
    told_id : str
        The track id that the detector gives to that object's box in this frame.
    elsewhere_px : array (4,) or None
        Where the detector tells of the accused track id instead, pixels of the camera's image.
    scale : float
        Pixels of `image` a pixel of the camera's image.
    """

    number: int
    stamp_ns: int
    alert: Alert | None
    image: GrayImage
    observed_px: FloatArray
    expected_px: FloatArray
    basis: Basis
    since_ns: int
    displacement_px: float
    object: ObjectView | None = None
    told_id: str = ""
    elsewhere_px: FloatArray | None = None
    scale: float = 1.0


class SnapshotRecorder:
    """Keeps the last few frames, and takes a snapshot of every alert (of the first six).

    Examples
    --------
    >>> SnapshotRecorder({}, claims_predict=False).finish()
    ()
    """

    def __init__(self, cameras: Mapping[str, MountedCamera], *, claims_predict: bool) -> None:
        self._cameras = cameras
        self._claims_predict = claims_predict
        self._ring: deque[View] = deque(maxlen=_RING_FRAMES)
        self._taken: list[Snapshot] = []
        self._nearest: tuple[tuple[View, ...], VisualEstimate | None] | None = None
        self._nearest_ratio = 0.0

    def add(
        self,
        view: View,
        verdict: Verdict,
        estimate: VisualEstimate | None,
        objects: Iterable[FollowedObject] = (),
    ) -> None:
        """Take in a frame, the verdict on it and what was seen in it."""
        self._ring.append(view)
        followed = tuple(objects)
        for alert in verdict.alerts:
            if len(self._taken) < _MOST_ALERTS:
                if alert.type in OBJECT_ALERTS:
                    self._taken.append(_of_object(view, alert, accused(followed, alert)))
                else:
                    self._taken.append(self._snapshot(tuple(self._ring), estimate, alert))
                self._nearest = None
        if not self._taken:
            self._keep_if_nearest(verdict, estimate)

    def _keep_if_nearest(self, verdict: Verdict, estimate: VisualEstimate | None) -> None:
        ratios = [
            result.statistic / result.threshold
            for result in verdict.checks
            if result.statistic is not None and result.threshold
        ]
        if max(ratios, default=0.0) > self._nearest_ratio:
            self._nearest_ratio = max(ratios)
            self._nearest = (tuple(self._ring), estimate)

    def finish(self) -> tuple[Snapshot, ...]:
        """The snapshots of the alerts; without alerts, that of the frame which came nearest to one."""
        if self._taken or self._nearest is None:
            return tuple(self._taken)
        return (self._snapshot(*self._nearest, None),)

    def _snapshot(
        self, ring: tuple[View, ...], estimate: VisualEstimate | None, alert: Alert | None
    ) -> Snapshot:
        view = ring[-1]
        onset_ns = alert.onset_ns if alert is not None else view.frame.stamp_ns
        honest = [index for index, other in enumerate(ring[:-1]) if other.frame.stamp_ns < onset_ns]
        views = ring[max(honest, default=0) :]
        if len(views) < 2:
            views = ring[-2:]
        observed = np.empty((0, 2)) if estimate is None else estimate.observed_px
        expected = np.empty((0, 2)) if estimate is None else estimate.predicted_px
        basis: Basis = "prediction"
        mounted = self._cameras.get(view.frame.camera)
        if not self._claims_predict and mounted is not None:
            pairs = corners_under_claim(views, mounted.model, observed)
            if pairs is not None:
                (observed, expected), basis = pairs, "claim"
        snapshot = Snapshot(
            number=view.number,
            stamp_ns=view.frame.stamp_ns,
            alert=alert,
            image=view.frame.image,
            observed_px=observed,
            expected_px=expected,
            basis=basis,
            since_ns=views[0].frame.stamp_ns,
            displacement_px=_median_length(expected - observed),
        )
        return _shrunk(snapshot)


def _of_object(view: View, alert: Alert, one: FollowedObject | None) -> Snapshot:
    """The frame with the accused object and its own corners: those of the camera's motion say nothing about it."""
    none = np.empty((0, 2))
    found = None if one is None else one.view
    observed, expected = (none, none) if found is None else (found.observed_px, found.predicted_px)
    return _shrunk(
        Snapshot(
            number=view.number,
            stamp_ns=view.frame.stamp_ns,
            alert=alert,
            image=view.frame.image,
            observed_px=observed,
            expected_px=expected,
            basis="object",
            since_ns=view.frame.stamp_ns,
            displacement_px=_median_length(expected - observed),
            object=found,
            told_id="" if one is None else one.view.told_id,
            elsewhere_px=None
            if one is None
            else elsewhere_px(alert.object, one.view.told_id, one.told_px, one.view.box_px),
        )
    )


def _median_length(displacement: FloatArray) -> float:
    return float(np.median(np.linalg.norm(displacement, axis=1))) if len(displacement) else math.nan


def _shrunk(snapshot: Snapshot) -> Snapshot:
    """Of a size fit for a page, with corners spread evenly over the list."""
    height, width = snapshot.image.shape
    factor = min(1.0, _PICTURE_WIDTH_PX / width)
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    image = cv2.resize(snapshot.image, size, interpolation=cv2.INTER_AREA)
    chosen = np.unique(np.linspace(0, len(snapshot.observed_px) - 1, _MOST_CORNERS).astype(int))
    chosen = chosen[: len(snapshot.observed_px)]
    return replace(
        snapshot,
        image=np.asarray(image, dtype=np.uint8),
        observed_px=(snapshot.observed_px[chosen] + 0.5) * factor - 0.5,
        expected_px=(snapshot.expected_px[chosen] + 0.5) * factor - 0.5,
        scale=factor,
    )
