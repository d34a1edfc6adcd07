"""Where the parts of moving actors are at a moment, as the renderer's matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import FloatArray
from belie.simulation.articulation import part_pose
from belie.simulation.still import stands
from belie.simulation.world import Actor, Part, World

_H_S = 1e-3
_SEEN_M = 320.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placed:
    """One actor that moves, or whose parts come and go.

    Parameters
    ----------
    actor : Actor
        Which.
    T_world_obj : array (4, 4)
        Its pose.
    parts : tuple of (Part, array, array)
        Each with its pose in the world (4, 4) and that pose's time derivative.
    centre, radius_m : array (3,), float
        A sphere around it.
    """

    actor: Actor
    T_world_obj: FloatArray
    parts: tuple[tuple[Part, FloatArray, FloatArray], ...]
    centre: FloatArray
    radius_m: float

    def is_within(self, planes: FloatArray) -> bool:
        """Whether any of its sphere is on the inner side of all planes (N, 4)."""
        return bool(
            (
                planes[:, :3] @ self.centre + planes[:, 3]
                > -self.radius_m * np.linalg.norm(planes[:, :3], axis=1)
            ).all()
        )


def placed_actors(world: World, t_s: float, eye: FloatArray) -> list[Placed]:
    """Where everything that moves is at a time, as far as it may be seen."""
    placed = []
    for actor in world.actors:
        parts = [part for part in actor.parts if part.shown_s or not stands(actor)]
        if not parts:
            continue
        pose = actor.motion.T_world_body(t_s).matrix()
        dims = actor.dimensions_m
        centre = pose[:3, 3] + pose[:3, 2] * (actor.base_m + 0.5 * dims[2])
        if float(np.linalg.norm(centre - eye)) > _SEEN_M:
            continue
        radius = 0.5 * float(np.linalg.norm(dims)) + 0.8
        own = _parts(actor, parts, pose, t_s, not stands(actor))
        placed.append(Placed(actor=actor, T_world_obj=pose, parts=own, centre=centre, radius_m=radius))
    return placed


def _parts(
    actor: Actor, parts: list[Part], pose: FloatArray, t_s: float, with_rates: bool
) -> tuple[tuple[Part, FloatArray, FloatArray], ...]:
    motion, shown = actor.motion, []
    way = motion.travelled_m(t_s)
    if with_rates:
        poses = [motion.T_world_body(t_s + h).matrix() for h in (-_H_S, _H_S)]
        ways = [motion.travelled_m(t_s + h) for h in (-_H_S, _H_S)]
    for part in parts:
        local = part_pose(part, way, t_s)
        if local is None:
            continue
        rate = np.zeros((4, 4))
        if with_rates:
            before, after = (part_pose(part, w, t_s) for w in ways)
            if before is not None and after is not None:
                rate = (poses[1] @ after - poses[0] @ before) / (2.0 * _H_S)
        shown.append((part, pose @ local, rate))
    return tuple(shown)
