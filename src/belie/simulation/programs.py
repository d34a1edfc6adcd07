"""Compiles the programs that a world needs in a weather, and sets their uniforms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, cast

import numpy as np

from belie.simulation import shaders, surface_shaders
from belie.simulation.weather import Weather
from belie.simulation.world import Material, World

if TYPE_CHECKING:
    import moderngl

UNITS = {
    "image": 0,
    "detail": 1,
    "still_shadow": 2,
    "moving_shadow": 3,
    "lamp_map": 4,
    "mirror": 5,
    "clouds": 6,
}  # texture units
_KINDS: dict[str, dict[str, str]] = {"opaque": {}, "cutout": {"CUTOUT": ""}, "decal": {"DECAL": ""}}


def kind_of(material: Material) -> str:
    """Which program draws a material: ``opaque``, ``cutout`` or ``decal``."""
    if material.is_decal:
        return "decal"
    return "cutout" if material.is_cutout else "opaque"


def has_sun(world: World, weather: Weather) -> bool:
    """Whether the sun shines into it."""
    return max(weather.sun) > 0.0 and not world.is_indoors


def has_mirror(world: World, weather: Weather) -> bool:
    """Whether its ground mirrors."""
    return weather.wetness > 0.0 and world.has_flat_ground and not world.is_indoors


class Programs:
    """All programs of a world in a weather, compiled when first needed.

    Parameters
    ----------
    context : moderngl.Context
        Where.
    world, weather : World, Weather
        What they leave out.
    """

    def __init__(self, context: moderngl.Context, world: World, weather: Weather) -> None:
        self._context = context
        self._defines = _defines(world, weather)
        self._mirrors = has_mirror(world, weather)
        self._fixed = {
            "sky": _compiled(context, shaders.FULL_SCREEN, shaders.SKY, {}),
            "far": _compiled(context, shaders.FULL_SCREEN, shaders.FAR_TRUTH, {}),
            "glow": _compiled(context, shaders.GLOW_VERTEX, shaders.GLOW_FRAGMENT, {}),
        }
        for kind in ("opaque", "cutout"):
            own = _KINDS[kind]
            self._fixed[f"shadow {kind}"] = _compiled(
                context, shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT, own
            )
            self._fixed[f"truth {kind}"] = _compiled(
                context, shaders.TRUTH_VERTEX, shaders.TRUTH_FRAGMENT, own
            )
        self._surfaces: dict[tuple[str, ...], moderngl.Program] = {}

    def __getitem__(self, name: str) -> moderngl.Program:
        """A program that draws no surface in colour: ``sky``, ``far``, ``glow``, ``shadow opaque`` and so on."""
        return self._fixed[name]

    def surface(self, traits: tuple[str, ...], *, is_mirrored: bool) -> moderngl.Program:
        """The program for surfaces of some `surface_traits`, as seen directly or in the wet road."""
        key = (*traits, "MIRRORED") if is_mirrored else traits
        if key not in self._surfaces:
            own = dict.fromkeys((*key, *(("MIRROR",) if self._mirrors and not is_mirrored else ())), "")
            self._surfaces[key] = _compiled(
                self._context, surface_shaders.VERTEX, surface_shaders.FRAGMENT, {**self._defines, **own}
            )
        return self._surfaces[key]


def surface_traits(material: Material, *, is_stained: bool) -> tuple[str, ...]:
    """What a program must be able to do for a material, as names that the shader knows.

    >>> surface_traits(Material(image=np.zeros((1, 1, 4), np.uint8), gloss=0.3), is_stained=False)
    ('GLOSS',)
    """
    traits = {
        **_KINDS[kind_of(material)],
        **({"GLOSS": ""} if material.gloss > 0.0 else {}),
        **({"GROUND": ""} if material.is_ground else {}),
        **({"TWO_SIDED": ""} if material.is_double_sided else {}),
        **({"STAINED": ""} if is_stained else {}),
    }
    return tuple(traits)


def _defines(world: World, weather: Weather) -> dict[str, str]:
    w = weather
    defines = {"NIGHT_GLOW": "1.3" if w.is_dark else ("0.12" if w.clouds >= 1.0 else "0.0")}
    if w.extinction_per_m > 0.0:
        defines["HAZE"] = ""
    if has_sun(world, w):
        defines["SUN"] = ""
    if (w.is_dark or world.is_indoors) and len(world.lamps):
        defines["LAMPS"] = ""
        # Outdoors a lamp lights what is below its head; indoors the whole height of the walls.
        defines["LAMP_FALLOFF"] = "1.0" if world.is_indoors else "smoothstep(9.0, 2.0, v_world.z)"
    if w.is_dark and world.headlights_m is not None:
        defines["HEADLIGHTS"] = ""
    if w.wetness > 0.0 and not world.is_indoors:
        defines |= {"WET": "", "WET_GROUND": "1.0" if world.has_flat_ground else "0.4"}
    return defines


def _compiled(
    context: moderngl.Context, vertex: str, fragment: str, defines: dict[str, str]
) -> moderngl.Program:
    program = context.program(vertex_shader=vertex, fragment_shader=shaders.with_defines(fragment, defines))
    for name, unit in UNITS.items():
        set_one(program, name, unit)
    return program


def set_one(program: moderngl.Program, name: str, value: object) -> None:
    """Set a uniform; one that a weather's program does without is passed over."""
    member = cast("moderngl.Uniform | None", program.get(name, None))
    if member is None:
        return
    if isinstance(value, np.ndarray):
        member.write(np.ascontiguousarray(value.T, np.float32).tobytes())
    else:
        member.value = value


def set_all(program: moderngl.Program, values: Mapping[str, object]) -> None:
    """Set many uniforms."""
    for name, value in values.items():
        set_one(program, name, value)
