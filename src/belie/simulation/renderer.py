"""Renders a world as a camera sees it."""

from __future__ import annotations

from types import TracebackType

from belie.geometry import SE3, CameraModel
from belie.simulation.imaging import ImagingSettings
from belie.simulation.rendered import Rendered
from belie.simulation.weather import Weather
from belie.simulation.world import World

__all__ = ["Rendered", "Renderer"]


class Renderer:
    """A world before a camera (signatures; the body follows)."""

    def __init__(
        self,
        world: World,
        camera: CameraModel,
        weather: Weather,
        seed: int,
        settings: ImagingSettings | None = None,
    ) -> None:
        raise NotImplementedError

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free everything."""

    def render(self, t_s: float, T_world_body: SE3 | None = None, *, with_truth: bool = True) -> Rendered:
        """Render one moment."""
        raise NotImplementedError
