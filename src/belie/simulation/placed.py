"""Where the parts of all actors are at a moment, as the renderer's matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import FloatArray
from belie.simulation.articulation import part_pose
from belie.simulation.motion import Parked
from belie.simulation.world import Actor, Part, World

_H_S = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placed:
    """One part of an actor.

    Parameters
    ----------
    actor, part : Actor, Part
        Which.
    is_first : bool
        Whether it is the actor's first part.
    model : array (4, 4)
        Part to world.
    rate : array (4, 4)
        Time derivative of `model`; zero unless asked for.
    """

    actor: Actor
    part: Part
    is_first: bool
    model: FloatArray
    rate: FloatArray


def placed_parts(world: World, t_s: float, *, with_rates: bool = False) -> list[Placed]:
    """All parts that are shown at a time."""
    placed = []
    for actor in world.actors:
        for k, part in enumerate(actor.parts):
            model = _model(actor, part, t_s)
            if model is None:
                continue
            rate = np.zeros((4, 4))
            if with_rates and not isinstance(actor.motion, Parked):
                before, after = _model(actor, part, t_s - _H_S), _model(actor, part, t_s + _H_S)
                if before is not None and after is not None:
                    rate = (after - before) / (2.0 * _H_S)
            placed.append(Placed(actor=actor, part=part, is_first=k == 0, model=model, rate=rate))
    return placed


def _model(actor: Actor, part: Part, t_s: float) -> FloatArray | None:
    T_obj_part = part_pose(part, actor.motion.travelled_m(t_s), t_s)
    if T_obj_part is None:
        return None
    return (actor.motion.T_world_body(t_s) @ T_obj_part).matrix()
