"""A scenario that is set up: its world, its camera and its object detector, ready to be looked at moment by moment."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from belie.geometry import SE3, CameraModel
from belie.simulation.sensors import ObjectDetector
from belie.simulation.sensors.sampling import NS_PER_S, Motion, generator
from belie.types import ConfigError, DetectionClaim, Frame, MountedCamera

if TYPE_CHECKING:
    from belie.simulation.labels import ObjectLabel
    from belie.simulation.rendered import Rendered
    from belie.simulation.scenario import Scenario
    from belie.simulation.weather import Weather
    from belie.simulation.world import World

START_NS = 1_700_000_000 * NS_PER_S  # of every recording: stamps as large as real ones
CAMERA = "/camera/image_raw"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """What one look at the world gives.

    Parameters
    ----------
    index : int
        Number of the frame.
    t_s : float
        Seconds from the start.
    frame : Frame
        The image as the detector gets it.
    rendered : Rendered
        The picture in colour, with depth and actor ids.
    T_world_body : SE3
        The true pose.
    labels : tuple of ObjectLabel
        The true objects in view.
    detections : DetectionClaim or None
        What the object detector says of it; None for frames that it leaves out.
    """

    index: int
    t_s: float
    frame: Frame
    rendered: Rendered
    T_world_body: SE3
    labels: tuple[ObjectLabel, ...]
    detections: DetectionClaim | None


class Picturer(Protocol):
    """Shows the world at a moment; `belie.simulation.renderer.Renderer` is one."""

    def render(self, t_s: float, ego: Motion | None = None) -> Rendered:
        """The picture at `t_s`, from where the robot is."""
        ...


class Labeller(Protocol):
    """Finds the true objects in a picture; `belie.simulation.labels.object_labels` is one."""

    def __call__(
        self, world: World, rendered: Rendered, camera: CameraModel, t_s: float, T_world_body: SE3
    ) -> tuple[ObjectLabel, ...]:
        """The objects in view."""
        ...


class Stage:
    """An open world; made by `open_stage`."""

    def __init__(
        self, scenario: Scenario, world: World, renderer: Picturer, *, weather: Weather, labels: Labeller
    ) -> None:
        self.scenario, self.world, self._labels = scenario, world, labels
        self.mounted = MountedCamera(model=scenario.camera_model(), T_body_cam=world.T_body_cam)
        self._renderer = renderer
        self._rng = generator(scenario.seed, CAMERA)
        self._detector = ObjectDetector(
            scenario.sensors.object_detector,
            self.mounted.model,
            visibility_m=weather.visibility_m,
            is_dark=weather.is_dark,
            seed=scenario.seed,
        )
        rate_hz = scenario.sensors.object_detector.rate_hz
        self._detect_every = max(1, round(scenario.frame_rate_hz / rate_hz)) if rate_hz > 0.0 else 0

    def look(self, index: int, ego: Motion | None = None) -> View:
        """Render frame `index`; to be called with growing indices, for the detector remembers.

        Parameters
        ----------
        index : int
            Number of the frame.
        ego : Motion, optional
            How the robot moves, instead of how the scenario moves it.
        """
        t_s = index / self.scenario.frame_rate_hz
        stamp_ns = START_NS + round(t_s * NS_PER_S)
        rendered = self._renderer.render(t_s, ego)
        T = (ego or self.world.ego).T_world_body(t_s)
        labels = self._labels(self.world, rendered, self.mounted.model, t_s, T)
        detections = None
        if self._detect_every and index % self._detect_every == 0:
            patched = frozenset(actor.id for actor in self.world.actors if actor.is_patched)
            detections = self._detector.look(labels, t_s, stamp_ns, patched=patched)
        received_ns = self.scenario.sensors.camera_arrival.received_ns(stamp_ns, self._rng)
        return View(
            index=index,
            t_s=t_s,
            frame=Frame(camera=CAMERA, stamp_ns=stamp_ns, received_ns=received_ns, image=rendered.gray),
            rendered=rendered,
            T_world_body=T,
            labels=labels,
            detections=detections,
        )


def build_world(scenario: Scenario) -> World:
    """The world of a scenario.

    Raises
    ------
    ConfigError
        If the scene knows no such manoeuvre.
    """
    from importlib import import_module

    scene = import_module(f"belie.simulation.scenes.{scenario.scene}")
    try:
        world: World = scene.build(
            seed=scenario.seed, manoeuvre=scenario.manoeuvre, duration_s=scenario.duration_s
        )
    except ValueError as error:
        raise ConfigError(f"scene {scenario.scene}: {error}") from None
    return world


@contextmanager
def open_stage(scenario: Scenario, world: World) -> Iterator[Stage]:
    """Set up a scenario's world before a camera.

    Raises
    ------
    MissingExtraError
        Without ``moderngl``.
    """
    from belie.simulation.imaging import ImagingSettings
    from belie.simulation.labels import object_labels
    from belie.simulation.renderer import Renderer
    from belie.simulation.weather import WEATHERS

    weather = WEATHERS[scenario.weather]
    imaging = ImagingSettings(rolling_shutter=scenario.rolling_shutter)
    with Renderer(world, scenario.camera_model(), weather, scenario.seed, imaging) as renderer:
        yield Stage(scenario, world, renderer, weather=weather, labels=object_labels)
