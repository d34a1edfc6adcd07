"""Textures that belong to no material: stains of the world, clouds, and the light of lamps on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from belie.simulation.lamp_map import lamp_map
from belie.simulation.programs import UNITS
from belie.simulation.textures.noise import fbm
from belie.simulation.world import World

if TYPE_CHECKING:
    import moderngl

_STAINS = ((0.7, 6), (1.5, 2), (1.7, 2))  # slope and lowest frequency of fine grain, stains, puddles
_CLOUDS = ((1.7, 2), (1.4, 3), (1.7, 2))
_SIZE = 512


class NoiseMaps:
    """The maps, uploaded; made and owned by `ColourPass`."""

    def __init__(self, context: moderngl.Context, world: World) -> None:
        self._maps = {"detail": _noise(context, 90, _STAINS), "clouds": _noise(context, 95, _CLOUDS)}
        light, self.lamp_area = lamp_map(world.lamps)
        lamps = context.texture(light.shape[::-1], 1, light.tobytes(), dtype="f2", alignment=1)
        lamps.repeat_x = lamps.repeat_y = False
        lamps.filter = (context.LINEAR, context.LINEAR)
        self._maps["lamp_map"] = lamps

    def bind(self) -> None:
        """Put the maps where the programs look for them."""
        for name, texture in self._maps.items():
            texture.use(UNITS[name])


def _noise(context: moderngl.Context, seed: int, layers: tuple[tuple[float, int], ...]) -> moderngl.Texture:
    image: npt.NDArray[np.uint8] = np.full((_SIZE, _SIZE, 4), 255, np.uint8)
    for k, (slope, lowest) in enumerate(layers):
        image[..., k] = fbm(_SIZE, seed + k, slope=slope, lowest=lowest) * 255.0
    texture = context.texture((_SIZE, _SIZE), 4, image.tobytes())
    texture.build_mipmaps()
    texture.filter = (context.LINEAR_MIPMAP_NEAREST, context.LINEAR)  # broad noise: one mip level does
    return texture
