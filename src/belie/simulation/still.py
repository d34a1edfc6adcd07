"""What never moves, joined by material: the static world and all actors that stand. Few draws instead of thousands."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3
from belie.simulation.motion import Parked
from belie.simulation.world import Actor, Material, Mesh, World

_Piece = tuple[Mesh, SE3, int]


def stands(actor: Actor) -> bool:
    """Whether an actor never moves; parts that come and go do not count."""
    return isinstance(actor.motion, Parked)


def still_meshes(world: World) -> list[tuple[Mesh, npt.NDArray[np.float32]]]:
    """One mesh of each material, world, and which actor each of its points belongs to (0: none), shape (N,)."""
    pieces: dict[Material, list[_Piece]] = {}
    for mesh in world.static:
        pieces.setdefault(mesh.material, []).append((mesh, SE3.identity(), 0))
    for actor in world.actors:
        if not stands(actor):
            continue
        for part in actor.parts:
            for mesh in () if part.shown_s else part.meshes:
                own_id = 0 if part.is_mount else actor.id
                pieces.setdefault(mesh.material, []).append((mesh, actor.motion.T_world_body(0.0), own_id))
    return [_joined(material, own) for material, own in pieces.items()]


def _joined(material: Material, pieces: list[_Piece]) -> tuple[Mesh, npt.NDArray[np.float32]]:
    starts = np.cumsum([0] + [len(mesh.points) for mesh, _, _ in pieces])
    mesh = Mesh(
        points=np.concatenate([T.apply(m.points.astype(np.float64)) for m, T, _ in pieces]).astype(
            np.float32
        ),
        normals=np.concatenate([m.normals @ T.R.T for m, T, _ in pieces]).astype(np.float32),
        uv=np.concatenate([m.uv for m, _, _ in pieces]),
        colours=np.concatenate([m.colours for m, _, _ in pieces]),
        triangles=np.concatenate([m.triangles + s for (m, _, _), s in zip(pieces, starts[:-1], strict=True)]),
        material=material,
    )
    ids = np.concatenate([np.full(len(m.points), i, np.float32) for m, _, i in pieces])
    return mesh, ids
