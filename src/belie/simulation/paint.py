"""Picks the program for each surface of a view, and tells it what the surface is made of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from belie.geometry import FloatArray
from belie.simulation.programs import Programs, set_all, set_one, surface_traits
from belie.simulation.weather import Weather
from belie.simulation.world import Material, World

if TYPE_CHECKING:
    import moderngl

_POLISHED = 0.1  # what is glossier than this has no stains
_IDENTITY = np.eye(4)


class Paint:
    """The programs of one view, each set up when it is first needed and told only what changes.

    Parameters
    ----------
    programs : Programs
        Of the world in its weather.
    world, weather : World, Weather
        Whether there are stains, how wet the ground is.
    common : mapping
        Uniforms of the whole view.
    is_mirrored : bool
        Whether the view is the one in the wet road.
    """

    def __init__(
        self,
        programs: Programs,
        world: World,
        weather: Weather,
        common: Mapping[str, object],
        *,
        is_mirrored: bool,
    ) -> None:
        self._programs, self._common, self._is_mirrored = programs, common, is_mirrored
        self._wetness, self._is_indoors = weather.wetness, world.is_indoors
        self._chosen: dict[tuple[Material, bool], moderngl.Program] = {}
        self._told: dict[int, tuple[float, float, float]] = {}
        self._places: dict[int, FloatArray] = {}

    def standing(self, material: Material) -> moderngl.Program:
        """For what never moves: its points are in the world."""
        return self._ready(material, moves=False, model=_IDENTITY)

    def moving(self, material: Material, model: FloatArray) -> moderngl.Program:
        """For a part of an actor, `model` (4, 4) is its pose."""
        return self._ready(material, moves=True, model=model)

    def _ready(self, material: Material, *, moves: bool, model: FloatArray) -> moderngl.Program:
        program = self._program(material, moves)
        own = (material.gloss, material.glow, self._wetness if material.is_ground else 0.0)
        if self._told.get(program.glo) != own:
            self._told[program.glo] = own
            set_all(program, dict(zip(("gloss", "glow", "wetness"), own, strict=True)))
        if self._places.get(program.glo) is not model:
            self._places[program.glo] = model
            set_one(program, "model", model)
        return program

    def _program(self, material: Material, moves: bool) -> moderngl.Program:
        key = (material, moves)
        if key not in self._chosen:
            # Stains stick to the world, not to what moves; and nothing polished has them.
            is_stained = not (moves or self._is_indoors or material.gloss > _POLISHED)
            traits = surface_traits(material, is_stained=is_stained)
            program = self._programs.surface(traits, is_mirrored=self._is_mirrored)
            if program.glo not in self._told:
                set_all(program, self._common)
            self._chosen[key] = program
        return self._chosen[key]
