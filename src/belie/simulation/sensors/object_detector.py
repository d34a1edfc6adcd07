"""An object detector with the habits of real ones: jitter, gaps, flicker, confusion, and things that are not there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from belie.geometry import SE3, CameraModel, FloatArray
from belie.simulation.sensors.detector_settings import ObjectDetectorSettings
from belie.simulation.sensors.sampling import GaussMarkov, generator
from belie.types import Detection, DetectionClaim

_SIMILAR = {
    "car": ("van",),
    "van": ("car", "truck"),
    "truck": ("van", "bus"),
    "bus": ("truck",),
    "pedestrian": ("cyclist",),
    "cyclist": ("pedestrian",),
}
_PEOPLE = {"pedestrian", "person", "cyclist"}
_LARGE = {"truck", "bus"}
_FALSE_LABELS = ("car", "pedestrian")
_FALSE_DISTANCE_M = (8.0, 60.0)


class Label(Protocol):
    """What is asked of a true object; `belie.simulation.labels.ObjectLabel` is one."""

    @property
    def id(self) -> int:
        """Of the actor."""
        ...

    @property
    def label(self) -> str:
        """Its class."""
        ...

    @property
    def box_px(self) -> FloatArray:
        """Left, top, right, bottom edge, shape (4,)."""
        ...

    @property
    def visible(self) -> float:
        """Share of it that nothing hides."""
        ...

    @property
    def distance_m(self) -> float:
        """From the camera."""
        ...

    @property
    def T_cam_obj(self) -> SE3:
        """Maps its coordinates to camera ones."""
        ...


@dataclass(slots=True)
class _Run:
    """Something that comes and goes in runs of messages: a two-state Markov chain."""

    on: bool = False

    def step(self, share: float, mean_length: float, rng: np.random.Generator) -> bool:
        """Move on by one message; on for `share` of the time, `mean_length` messages at once."""
        if share >= 1.0:
            self.on = True
        elif self.on:
            self.on = rng.random() >= 1.0 / mean_length
        else:
            self.on = rng.random() < share / (mean_length * (1.0 - share))
        return self.on


@dataclass(slots=True)
class _Track:
    """What the detector remembers of one true object."""

    track_id: str
    position: GaussMarkov
    missed: _Run = field(default_factory=_Run)
    confused: _Run = field(default_factory=_Run)
    wrong_label: str = ""
    gap: int = 0


@dataclass(slots=True)
class _Ghost:
    """An object that is not there."""

    detection: Detection


class ObjectDetector:
    """Sees true objects as a real detector does: 2-D boxes, and positions as from LiDAR.

    Parameters
    ----------
    settings : ObjectDetectorSettings
        How good it is.
    camera : CameraModel
        Bounds its boxes.
    visibility_m : float or None
        Meteorological visibility; None: clear.
    is_dark : bool
        Night.
    seed : int
        Of everything random.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> detector = ObjectDetector(ObjectDetectorSettings(), camera, visibility_m=None, is_dark=False, seed=1)
    >>> car = SimpleNamespace(id=3, label="car", box_px=np.array([300.0, 200.0, 380.0, 260.0]), visible=1.0,
    ...                       distance_m=12.0, T_cam_obj=SE3.from_translation([0.5, 1.0, 12.0]))
    >>> seen = [detector.look([car], 0.1 * k, 100_000_000 * k) for k in range(200)]
    >>> 0.9 < sum(any(d.track_id == "1" for d in claim.detections) for claim in seen) / 200 < 1.0
    True
    """

    def __init__(
        self,
        settings: ObjectDetectorSettings,
        camera: CameraModel,
        *,
        visibility_m: float | None,
        is_dark: bool,
        seed: int,
        source: str = "/detections",
    ) -> None:
        self._settings, self._camera, self._source = settings, camera, source
        self._visibility_m, self._is_dark = visibility_m, is_dark
        self._rng = generator(seed, source)
        self._tracks: dict[int, _Track] = {}
        self._ghosts: list[_Ghost] = []
        self._next_id = 1

    def miss_probability(self, label: Label) -> float:
        """Share of messages in which an object is missed: small, foggy, hidden and dark each take their part."""
        s = self._settings
        height_px = float(label.box_px[3] - label.box_px[1])
        seen = 1.0 - (s.night_miss if self._is_dark else s.miss)
        seen *= _logistic((height_px - s.half_seen_px) / s.half_seen_width_px)
        seen *= _logistic((label.visible - s.half_seen_visible) / (0.25 * s.half_seen_visible))
        if self._visibility_m is not None:
            contrast = math.exp(math.log(0.05) * label.distance_m / self._visibility_m)
            seen *= _logistic((contrast - s.half_seen_contrast) / (0.25 * s.half_seen_contrast))
        return 1.0 - seen

    def look(
        self, labels: Sequence[Label], t_s: float, stamp_ns: int, *, patched: frozenset[int] = frozenset()
    ) -> DetectionClaim:
        """The claim of one message.

        Parameters
        ----------
        labels : sequence of Label
            All objects in view.
        t_s : float
            Seconds from the start; never runs backwards.
        stamp_ns : int
            Of the frame that is looked at.
        patched : frozenset of int
            Ids of the objects that bear an adversarial patch.
        """
        found = [self._see(label, t_s, label.id in patched) for label in labels]
        in_view = {label.id for label in labels}
        for actor, track in self._tracks.items():
            track.gap += actor not in in_view
        detections = [detection for detection in found if detection is not None]
        return DetectionClaim(
            source=self._source,
            stamp_ns=stamp_ns,
            received_ns=self._settings.arrival.received_ns(stamp_ns, self._rng),
            detections=(*detections, *self._imagined()),
        )

    def _see(self, label: Label, t_s: float, is_patched: bool) -> Detection | None:
        s, rng = self._settings, self._rng
        track = self._tracks.get(label.id)
        if track is None:
            track = self._tracks[label.id] = self._new_track(label)
        miss = self.miss_probability(label)
        run = self._gap_frames(label, miss)
        missed = track.missed.step(miss, run, rng)
        was_confused = track.confused.on
        confused = track.confused.step(s.confusion, run, rng)
        if confused and not was_confused:
            track.wrong_label = str(rng.choice(_SIMILAR.get(label.label, (label.label,))))
        patch_works = is_patched and s.patch != "none" and rng.random() < s.patch_rate
        box_px = self._jittered(label.box_px)
        error_m = track.position.at(t_s)
        if missed or (patch_works and s.patch == "hide"):
            track.gap += 1
            return None
        if track.gap > s.track_memory_frames:
            track.track_id = self._new_id()
        track.gap = 0
        name = track.wrong_label if confused else label.label
        in_range = label.distance_m <= s.lidar_range_m
        sigma_m = self._position_sigma_m(label.label)
        return Detection(
            label=s.patch_label if patch_works else name,
            score=float(np.clip(0.95 - 0.4 * miss - 0.2 * confused + 0.03 * rng.normal(), 0.05, 1.0)),
            track_id=track.track_id,
            box_px=box_px,
            position_m=label.T_cam_obj.t + error_m if in_range else None,
            covariance=sigma_m**2 * np.eye(3) if in_range and sigma_m > 0.0 else None,
        )

    def _gap_frames(self, label: Label, miss: float) -> float:
        """Mean length of a gap: what is hard to see stays hard to see, what is in plain view is lost by chance."""
        s = self._settings
        hard = s.person_miss_frames if label.label in _PEOPLE else s.vehicle_miss_frames
        easy = min(s.plain_miss_frames, hard)
        hardness = min(max((miss - s.night_miss) / (0.5 - s.night_miss), 0.0), 1.0)
        return easy + (hard - easy) * hardness

    def _new_track(self, label: Label) -> _Track:
        sigma = np.full(3, self._position_sigma_m(label.label))
        wander = GaussMarkov(sigma, self._settings.position_correlation_s, self._rng)
        return _Track(track_id=self._new_id(), position=wander)

    def _new_id(self) -> str:
        self._next_id += 1
        return str(self._next_id - 1)

    def _position_sigma_m(self, label: str) -> float:
        s = self._settings
        if label in _PEOPLE:
            return s.person_position_m
        return s.large_position_m if label in _LARGE else s.vehicle_position_m

    def _jittered(self, box_px: FloatArray) -> FloatArray:
        s = self._settings
        sides = np.tile(box_px[2:] - box_px[:2], 2)
        sigma = np.maximum(s.box_jitter * sides, s.box_jitter_floor_px)
        return self._clipped(box_px + sigma * self._rng.normal(size=4))

    def _clipped(self, box_px: FloatArray) -> FloatArray:
        """Inside the image, with its edges in order."""
        x = np.sort(np.clip(box_px[[0, 2]], 0.0, self._camera.width))
        y = np.sort(np.clip(box_px[[1, 3]], 0.0, self._camera.height))
        return np.array([x[0], y[0], x[1], y[1]])

    def _imagined(self) -> list[Detection]:
        """Objects that are not there: each lives for some messages, where it was."""
        s, rng = self._settings, self._rng
        ends = 1.0 / s.false_positive_frames
        self._ghosts = [ghost for ghost in self._ghosts if rng.random() >= ends]
        self._ghosts += [_Ghost(self._ghost()) for _ in range(rng.poisson(s.false_positives))]
        return [ghost.detection for ghost in self._ghosts]

    def _ghost(self) -> Detection:
        """A false object where one could stand: on the ground, at some distance, of a fitting size."""
        rng, camera = self._rng, self._camera
        label = str(rng.choice(_FALSE_LABELS))
        z_m = float(rng.uniform(*_FALSE_DISTANCE_M))
        length_m, height_m = (0.6, 1.75) if label in _PEOPLE else (2.5, 1.5)
        u_px = float(rng.uniform(0.0, camera.width))
        x_m, bottom_m = (u_px - camera.cx) / camera.fx * z_m, 1.5
        corners = np.array(
            [[x_m - 0.5 * length_m, bottom_m - height_m, z_m], [x_m + 0.5 * length_m, bottom_m, z_m]]
        )
        edges = camera.project(corners).ravel() + 0.5  # pixel centres are integers, edges are not
        return Detection(
            label=label,
            score=float(np.clip(rng.normal(0.45, 0.12), 0.05, 0.9)),
            track_id=self._new_id(),
            box_px=self._clipped(edges),
        )


def _logistic(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-max(min(x, 50.0), -50.0)))
