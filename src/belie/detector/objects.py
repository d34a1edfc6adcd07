"""Section III-C, conducted: every object is followed by its own pixels, and its detections held against them."""

from __future__ import annotations

import numpy as np

from belie.checks.objects import ObjectSettings
from belie.detector.alerts import Judgement
from belie.detector.object_answers import answer, withhold
from belie.detector.object_habits import ObjectHabits
from belie.detector.object_stream import ObjectStream
from belie.detector.object_view import ObjectView, view_of
from belie.detector.scene_witness import Scene, SceneWitness
from belie.geometry import CameraModel
from belie.odometry.local_features import ImageStack
from belie.odometry.still_background import StillBackground
from belie.odometry.tracking import TrackingSettings
from belie.types import (
    Claim,
    DetectionClaim,
    Frame,
    GrayImage,
    VisualEstimate,
)

_MOST_AHEAD_NS = 5_000_000_000


class ObjectStage:
    """The object checks of the `default` profile, for all detectors of a robot."""

    def __init__(
        self,
        camera: CameraModel,
        settings: ObjectSettings,
        tracking: TrackingSettings,
        false_alarms_per_hour: float,
    ) -> None:
        self._camera, self._settings, self._tracking = camera, settings, tracking
        self._rate = false_alarms_per_hour
        self.streams: dict[str, ObjectStream] = {}
        self._scene = SceneWitness(camera)
        self._background = StillBackground(camera.fx)
        self._previous: ImageStack | None = None
        self._last_ns: int | None = None  # stamp of the last frame, judged by or not
        self._is_blind = False  # that frame was not judged by

    @property
    def views(self) -> tuple[ObjectView, ...]:
        """All objects as they stand after the last frame."""
        return tuple(
            view_of(
                track,
                stream.source,
                heard=stream.heard,
                is_established=track.weight >= self._settings.established,
            )
            for stream in self.streams.values()
            for track in stream.tracks
        )

    def habits(self) -> dict[str, ObjectHabits]:
        """How each detector errs, by source."""
        return {source: stream.habits() for source, stream in self.streams.items()}

    def take(self, claims: tuple[Claim, ...], now_ns: int) -> None:
        """Keep the messages until their frame has come; not those of a broken clock."""
        for claim in claims:
            if isinstance(claim, DetectionClaim) and claim.stamp_ns - now_ns < _MOST_AHEAD_NS:
                if claim.source not in self.streams:
                    self.streams[claim.source] = ObjectStream(
                        claim.source,
                        self._camera,
                        self._settings,
                        self._tracking,
                        self._rate,
                        self._scene,
                        self._background,
                    )
                self.streams[claim.source].waiting.append(claim)

    def update(
        self,
        frame: Frame,
        estimate: VisualEstimate | None = None,
        scene: Scene | None = None,
        *,
        doubted: str = "",
        half: GrayImage | None = None,
    ) -> list[Judgement]:
        """Follow all objects into a frame and judge what was told of them.

        `estimate` and `scene`: the camera's own motion since the previous frame and the depths of its corners, where
        they are known. `doubted`: why the image is not fit to judge by; objects stay where they were. `half`: the image
        at half its size, if it is there already.
        """
        half_ns = 0 if self._last_ns is None else (frame.stamp_ns - self._last_ns) // 2
        self._last_ns = frame.stamp_ns
        if not self.streams:
            return []
        if doubted:
            self._is_blind = True
            for stream in self.streams.values():
                stream.pass_over(frame.stamp_ns + half_ns)
            return [j for stream in self.streams.values() for j in withhold(stream, f"not judged: {doubted}")]
        current = ImageStack(_as_gray(frame.image), half)
        self._scene.move(estimate, scene)
        self._background.see(current, estimate, frame.stamp_ns)
        # Since an image that was not judged by, the camera has turned more than once.
        known = estimate is not None and estimate.inliers > 0 and not self._is_blind
        R_cur_prev = estimate.T_prev_cur.R.T if estimate is not None and known else None
        self._is_blind = False
        judgements: list[Judgement] = []
        for stream in self.streams.values():
            if self._previous is not None:
                stream.follow(self._previous, current, frame.stamp_ns, R_cur_prev)
            stream.hear(frame.stamp_ns, half_ns, current)
            judgements += answer(stream, frame.stamp_ns, current.size)
        self._previous = current
        return judgements


def _as_gray(image: GrayImage) -> GrayImage:
    return np.ascontiguousarray(image)
