"""Renders a world as a camera sees it, on a GPU or on the CPU (Mesa llvmpipe)."""

from __future__ import annotations

from types import TracebackType

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import CameraModel
from belie.simulation.colour_pass import ColourPass
from belie.simulation.gpu import open_context
from belie.simulation.imaging import Imaging, ImagingSettings
from belie.simulation.placed import placed_actors
from belie.simulation.programs import Programs
from belie.simulation.projection import ideal_camera, sight_m
from belie.simulation.rendered import Rendered
from belie.simulation.sensors.sampling import Motion
from belie.simulation.stock import Stock
from belie.simulation.truth_pass import SKY_M, TruthPass
from belie.simulation.weather import Weather
from belie.simulation.world import World

__all__ = ["Rendered", "Renderer"]


class Renderer:
    """A world before a camera; a context manager.

    Parameters
    ----------
    world : World
        What is seen.
    camera : CameraModel
        By which lens; a distorted one is rendered through a wider pinhole.
    weather : Weather
        In which light.
    seed : int
        Of rain and noise: the same seed and time, the same pixels, whatever was rendered before.
    settings : ImagingSettings, optional
        The camera as a device.

    Raises
    ------
    MissingExtraError
        Without ``moderngl``.
    BelieError
        Without EGL.
    """

    def __init__(
        self,
        world: World,
        camera: CameraModel,
        weather: Weather,
        seed: int,
        settings: ImagingSettings | None = None,
    ) -> None:
        self._world, self._camera = world, camera
        self._pinhole = ideal_camera(camera)
        self._context = open_context()
        try:
            programs = Programs(self._context, world, weather)
            stock = Stock(self._context, world, sight_m(weather))
            self._colour = ColourPass(self._context, programs, stock, world, self._pinhole, weather)
            self._truth = TruthPass(self._context, programs, stock, world, self._pinhole)
            self._imaging = Imaging(
                camera,
                self._pinhole,
                world,
                weather,
                seed,
                settings if settings is not None else ImagingSettings(),
            )
        except BaseException:
            self._context.release()
            raise

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free everything."""
        self._context.release()

    def render(self, t_s: float, ego: Motion | None = None, *, with_truth: bool = True) -> Rendered:
        """Render one moment.

        Parameters
        ----------
        t_s : float
            Seconds from the start: the middle of the exposure of the middle row.
        ego : Motion, optional
            How the robot moves, instead of how the world moves it.
        with_truth : bool
            Whether depth and ids are wanted.
        """
        ego = ego or self._world.ego
        T_world_cam = ego.T_world_body(t_s) @ self._world.T_body_cam
        linear, angular = ego.twist(t_s)
        placed = placed_actors(self._world, t_s, T_world_cam.t)
        colour = self._colour.draw(placed, T_world_cam)
        truth: npt.NDArray[np.float32] | None = None
        if with_truth or self._imaging.needs_motion:
            truth = self._truth.draw(placed, T_world_cam, linear, angular)
        bgr = self._imaging.expose(colour, truth, t_s, T_world_cam)
        depth_m, ids = self._through_lens(truth) if with_truth and truth is not None else (None, None)
        return Rendered(bgr=bgr, gray=cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), depth_m=depth_m, ids=ids)

    def _through_lens(
        self, truth: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Depth and ids, seen through the lens: of each pixel the nearest one of the pinhole's picture."""
        if self._imaging.lens_map is not None:
            truth = cv2.remap(
                truth, *self._imaging.lens_map, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE
            )
        depth_m = truth[..., 0].copy()
        depth_m[depth_m > SKY_M] = np.inf
        return depth_m, truth[..., 1].round().astype(np.int32)
