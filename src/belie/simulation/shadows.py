"""Shadows of the sun: one map of what stands, kept while the camera stays near, and one of what moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from belie.geometry import SE3, FloatArray
from belie.simulation.placed import Placed
from belie.simulation.programs import UNITS, Programs, set_all, set_one
from belie.simulation.projection import sun_projection
from belie.simulation.stock import Stock

if TYPE_CHECKING:
    import moderngl

_TEXELS = 2048
_STEP_M = 16.0  # the map of what stands is drawn anew after this way
_AHEAD = 0.6  # its middle lies this share of its reach before the camera
_IDENTITY = np.eye(4)


class ShadowMaps:
    """Depth as the sun sees it, around a place that depends on the camera's alone: never on what was drawn before.

    Parameters
    ----------
    context : moderngl.Context
        Where.
    towards_sun : array (3,) or None
        Unit vector, world; None: there is no sun, and the maps are dummies.
    reach_m : float
        Half the side of the square that they cover.
    """

    def __init__(self, context: moderngl.Context, towards_sun: FloatArray | None, reach_m: float) -> None:
        self._towards_sun, self._reach_m = towards_sun, reach_m
        self.projection = _IDENTITY
        self._middle: tuple[float, ...] | None = None
        self._maps = {}
        for name, share in (("still_shadow", 1), ("moving_shadow", 2)):
            texels = _TEXELS // share if towards_sun is not None else 1
            texture = context.depth_texture((texels, texels))
            texture.compare_func = "<="
            texture.repeat_x = texture.repeat_y = False
            texture.filter = (context.LINEAR, context.LINEAR)
            self._maps[name] = (texture, context.framebuffer(depth_attachment=texture))

    def bind(self) -> None:
        """Put the maps where the programs look for them."""
        for name, (texture, _) in self._maps.items():
            texture.use(UNITS[name])

    def cast(self, programs: Programs, stock: Stock, placed: list[Placed], T_world_cam: SE3) -> None:
        """Draw both maps for a place of the camera."""
        if self._towards_sun is None:
            return
        ahead = T_world_cam.t + _AHEAD * self._reach_m * T_world_cam.R[:, 2] * [1.0, 1.0, 0.0]
        middle = tuple((np.round(ahead / _STEP_M) * _STEP_M * [1.0, 1.0, 0.0]).tolist())
        if middle != self._middle:
            self._middle = middle
            self.projection = sun_projection(self._towards_sun, np.array(middle), self._reach_m, _TEXELS)
            self._still(programs, stock)
        self._moving(programs, stock, [b for b in placed if self._may_cast(b, ahead)])

    def _may_cast(self, body: Placed, ahead: FloatArray) -> bool:
        return float(np.linalg.norm(body.centre - ahead)) < 1.4 * self._reach_m

    def _still(self, programs: Programs, stock: Stock) -> None:
        for kind, program in self._begin("still_shadow", programs):
            for mesh in stock.still(kind):
                stock.draw(mesh, program, None)

    def _moving(self, programs: Programs, stock: Stock, bodies: list[Placed]) -> None:
        for kind, program in self._begin("moving_shadow", programs):
            for body in bodies:
                for part, model, _ in body.parts:
                    set_one(program, "model", model)
                    for mesh in stock.of_part(part, kind):
                        stock.draw(mesh, program, None)

    def _begin(self, name: str, programs: Programs) -> list[tuple[str, moderngl.Program]]:
        target = self._maps[name][1]
        target.use()
        target.clear(depth=1.0)
        pairs = [(kind, programs[f"shadow {kind}"]) for kind in ("opaque", "cutout")]
        for _, program in pairs:
            set_all(program, {"sun_projection": self.projection, "model": _IDENTITY})
        return pairs
