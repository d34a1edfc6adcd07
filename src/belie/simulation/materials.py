"""The materials of the simulated world; each is made once and shared."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TypedDict, Unpack

from belie.simulation.textures import ground, indoor, openings, plants, vehicles, walls
from belie.simulation.textures.noise import Rgba
from belie.simulation.world import Material

WALL_KINDS = ("plaster", "brick", "ashlar", "concrete")
_WALLS = {"plaster": walls.plaster, "brick": walls.brick, "ashlar": walls.ashlar, "concrete": walls.concrete}


class Look(TypedDict, total=False):
    """What a material may have beside its picture; see `Material`."""

    gloss: float
    glow: float
    seen_m: float
    is_cutout: bool
    is_decal: bool
    is_ground: bool
    is_double_sided: bool


@lru_cache(maxsize=128)
def surface(image_of: Callable[..., Rgba], *arguments: object, **look: Unpack[Look]) -> Material:
    """A material of a texture function's picture: the same arguments, the same material."""
    return Material(image=image_of(*arguments), **look)


def wall(kind: str, seed: int) -> Material:
    """A wall of one of `WALL_KINDS`, 4 m a tile."""
    return surface(_WALLS[kind], seed)


def windows() -> Material:
    """Atlas of windows."""
    return surface(openings.windows, 1, gloss=0.55)


def doors() -> Material:
    """Atlas of doors."""
    return surface(openings.doors, 1, gloss=0.1)


def shops() -> Material:
    """Atlas of shop fronts."""
    return surface(openings.shops, 1, gloss=0.35)


def asphalt() -> Material:
    """Road, 6 m a tile."""
    return surface(ground.asphalt, 1, is_ground=True)


def pavement() -> Material:
    """Pavement, 4 m a tile."""
    return surface(ground.slabs, 1, is_ground=True)


def kerb() -> Material:
    """Kerb stones, 4 m a tile."""
    return surface(ground.kerb, 1)


def lawn() -> Material:
    """Grass, 4 m a tile."""
    return surface(ground.grass, 1)


def field(kind: str) -> Material:
    """A field, 12 m a tile."""
    return surface(ground.field, kind, 3)


def decal(image_of: Callable[..., Rgba], *arguments: object) -> Material:
    """Something thin that lies on the ground."""
    return surface(image_of, *arguments, is_decal=True, is_ground=True)


def blob() -> Material:
    """The darkness below a body; wet or dry."""
    return surface(ground.blob, is_decal=True)


def leaves(seed: int) -> Material:
    """Sprays of leaves."""
    return surface(plants.leaves, seed, is_cutout=True, is_double_sided=True)


def blades() -> Material:
    """Tall grass."""
    return surface(plants.blades, 1, is_cutout=True, is_double_sided=True)


def bark() -> Material:
    """Bark."""
    return surface(plants.bark, 1)


def roof_tiles() -> Material:
    """Roof tiles, 3 m a tile."""
    return surface(plants.tiles, 1)


def metal() -> Material:
    """Painted metal, to be tinted."""
    return surface(vehicles.sheet, gloss=0.12)


def railing() -> Material:
    """Thin rails, to be tinted: from afar less than a pixel wide."""
    return surface(vehicles.sheet, seen_m=110.0)


def cloth() -> Material:
    """Clothes, to be tinted."""
    return surface(vehicles.cloth, 5)


def lamp(colour: tuple[float, float, float], glow: float) -> Material:
    """A lamp's glass."""
    return surface(vehicles.lamp, colour, glow, gloss=0.3)


def bright_lamp(colour: tuple[float, float, float]) -> Material:
    """A lamp that is lit by day too."""
    return surface(vehicles.lamp, colour, 1.0, glow=1.0)


def sign(image_of: Callable[..., Rgba], *arguments: object) -> Material:
    """A traffic sign cut out of sheet metal."""
    return surface(image_of, *arguments, is_cutout=True)


def picture(image_of: Callable[..., Rgba], *arguments: object) -> Material:
    """A printed rectangle."""
    return surface(image_of, *arguments)


def indoor_wall() -> Material:
    """A painted wall, 4 m a tile."""
    return surface(indoor.painted_wall, 1)


def vinyl() -> Material:
    """Indoor floor, 3 m a tile."""
    return surface(indoor.vinyl, 1, gloss=0.06)


def ceiling() -> Material:
    """Ceiling boards, 2.4 m a tile."""
    return surface(indoor.ceiling)


def office_door(number: int) -> Material:
    """A door inside a building."""
    return surface(indoor.office_door, number, gloss=0.1)


def cardboard(seed: int) -> Material:
    """A cardboard box."""
    return surface(indoor.cardboard, seed)


def light_panel() -> Material:
    """A ceiling light."""
    return surface(indoor.light_panel, glow=1.0)
