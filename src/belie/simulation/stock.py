"""All meshes and textures of a world on the graphics side, sorted by how they are drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

from belie.geometry import FloatArray
from belie.simulation.gpu import GpuMesh, texture_of, upload, visible_chunks
from belie.simulation.programs import UNITS, kind_of
from belie.simulation.still import still_meshes
from belie.simulation.world import Material, Part, World

if TYPE_CHECKING:
    import moderngl

_RING_M = 12.0


class Stock:
    """Meshes and textures, uploaded when first needed.

    Parameters
    ----------
    context : moderngl.Context
        Where.
    world : World
        Whose.
    reach_m : float
        How far one sees.
    """

    def __init__(self, context: moderngl.Context, world: World, reach_m: float) -> None:
        self._context, self._reach_m = context, reach_m
        still = [upload(context, mesh, ids, chunked=True) for mesh, ids in still_meshes(world)]
        self._still = _by_kind(still)
        self._moving: dict[Part, dict[str, list[GpuMesh]]] = {}
        self._textures: dict[Material, moderngl.Texture] = {}

    def still(self, kind: str) -> list[GpuMesh]:
        """What never moves, of a kind."""
        return self._still.get(kind, [])

    def of_part(self, part: Part, kind: str) -> list[GpuMesh]:
        """The meshes of an actor's part, of a kind."""
        if part not in self._moving:
            self._moving[part] = _by_kind(
                [upload(self._context, mesh, chunked=False) for mesh in part.meshes]
            )
        return self._moving[part].get(kind, [])

    def draw(self, mesh: GpuMesh, program: moderngl.Program, planes: FloatArray | None) -> None:
        """Draw a mesh with its texture, as far as it is within the planes."""
        self._bind(mesh.material)
        mesh.draw(self._context, program, planes, self._reach_m)

    def _bind(self, material: Material) -> None:
        if material not in self._textures:
            self._textures[material] = texture_of(self._context, material)
        self._textures[material].use(UNITS["image"])

    def nearest_first(
        self, kind: str, planes: FloatArray, eye: FloatArray
    ) -> list[tuple[GpuMesh, list[tuple[int, int]]]]:
        """What never moves, of a kind, in runs from near to far: what is hidden is then not lit.

        Neighbours of one mesh stay together.
        """
        near = [
            (distance, k, first, count)
            for k, mesh in enumerate(self.still(kind))
            for distance, first, count in visible_chunks(mesh.chunks, planes, eye)
            if distance < mesh.material.seen_m
        ]
        ordered: list[tuple[GpuMesh, list[tuple[int, int]]]] = []
        # By rings of some metres, so that a material is not taken up again for each of its runs.
        for _, k, first, count in sorted(near, key=lambda run: (int(run[0] / _RING_M), run[1], run[2])):
            mesh = self.still(kind)[k]
            if ordered and ordered[-1][0] is mesh:
                ordered[-1][1].append((first, count))
            else:
                ordered.append((mesh, [(first, count)]))
        return ordered

    def draw_runs(self, mesh: GpuMesh, program: moderngl.Program, runs: list[tuple[int, int]]) -> None:
        """Draw some runs of a mesh with its texture."""
        self._bind(mesh.material)
        array = mesh.array(self._context, program)
        for first, count in runs:
            array.render(vertices=count, first=first)


def _by_kind(meshes: list[GpuMesh]) -> dict[str, list[GpuMesh]]:
    sorted_out: dict[str, list[GpuMesh]] = {}
    for mesh in meshes:
        sorted_out.setdefault(kind_of(mesh.material), []).append(mesh)
    return sorted_out
