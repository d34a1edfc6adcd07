"""The OpenGL side of meshes and materials: contexts, buffers, textures, and what of them is in view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray
from belie.simulation.world import Material, Mesh
from belie.types import BelieError, MissingExtraError

if TYPE_CHECKING:
    import moderngl

_CHUNK_M = 40.0


def open_context() -> moderngl.Context:
    """An OpenGL context without a window, through EGL; Mesa's llvmpipe where there is no GPU.

    Raises
    ------
    MissingExtraError
        Without ``moderngl``.
    BelieError
        Where EGL or OpenGL cannot be loaded.
    """
    try:
        import moderngl
    except ImportError:
        raise MissingExtraError("moderngl", "sim") from None
    try:
        settings: dict[str, Any] = {"backend": "egl"}  # moderngl's stub takes each setting for a dict
        return moderngl.create_context(standalone=True, require=330, **settings)
    except Exception as error:  # glcontext raises bare Exception for a library that is not there
        why = " ".join(str(error).split())
        raise BelieError(
            f"no OpenGL without a screen ({why}); on Debian or Ubuntu: apt install libegl1 libgl1"
        ) from None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chunks:
    """Runs of triangles that lie together.

    Parameters
    ----------
    starts : array (K + 1,)
        First index of each run; the last is the end.
    low, high : array (K, 3)
        Their boxes.
    """

    starts: npt.NDArray[np.int64]
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GpuMesh:
    """A mesh in buffers, its triangles sorted by place."""

    vertices: moderngl.Buffer
    indices: moderngl.Buffer
    material: Material
    chunks: Chunks
    arrays: dict[int, Any]

    def array(self, context: moderngl.Context, program: moderngl.Program) -> moderngl.VertexArray:
        """Its vertex array for a program, made once."""
        key = program.glo
        if key not in self.arrays:
            names = ("in_point", "in_normal", "in_uv", "in_colour", "in_id")
            formats = [("3f", "12x"), ("3f", "12x"), ("2f", "8x"), ("4f1", "4x"), ("1f", "4x")]
            layout = " ".join(
                used if n in program else skip for n, (used, skip) in zip(names, formats, strict=True)
            )
            present = [name for name in names if name in program]
            self.arrays[key] = context.vertex_array(
                program, [(self.vertices, layout, *present)], index_buffer=self.indices, index_element_size=4
            )
        array: moderngl.VertexArray = self.arrays[key]
        return array

    def draw(
        self,
        context: moderngl.Context,
        program: moderngl.Program,
        planes: FloatArray | None = None,
        reach_m: float = 0.0,
    ) -> None:
        """Draw what is on the inner side of all planes (N, 4), of which the last stands `reach_m` away."""
        array = self.array(context, program)
        if planes is not None and self.material.seen_m < reach_m:
            planes = planes.copy()
            planes[-1, 3] -= reach_m - self.material.seen_m
        for first, count in visible_runs(self.chunks, planes):
            array.render(vertices=count, first=first)


def upload(
    context: moderngl.Context, mesh: Mesh, ids: npt.NDArray[np.float32] | float = 0.0, *, chunked: bool
) -> GpuMesh:
    """A mesh in buffers, with the actor of each point.

    `chunked` sorts its triangles into squares of 40 m, so that those out of view can be left out.
    """
    packed = np.zeros(
        len(mesh.points),
        np.dtype([("p", "f4", 3), ("n", "f4", 3), ("t", "f4", 2), ("c", "u1", 4), ("i", "f4")]),
    )
    packed["p"], packed["n"], packed["t"], packed["c"] = mesh.points, mesh.normals, mesh.uv, mesh.colours
    packed["i"] = ids
    triangles, chunks = _sorted_chunks(mesh.points, mesh.triangles, chunked)
    return GpuMesh(
        vertices=context.buffer(packed.tobytes()),
        indices=context.buffer(np.ascontiguousarray(triangles, np.int32).tobytes()),
        material=mesh.material,
        chunks=chunks,
        arrays={},
    )


def _sorted_chunks(
    points: npt.NDArray[np.float32], triangles: npt.NDArray[np.int32], chunked: bool
) -> tuple[npt.NDArray[np.int32], Chunks]:
    # A few triangles are drawn sooner than they are sorted out.
    size = _CHUNK_M if len(triangles) > 1500 else 4.0 * _CHUNK_M
    middles = points[triangles].mean(axis=1)
    cells = (
        np.floor(middles[:, :2] / size).astype(np.int64)
        if chunked
        else np.zeros((len(triangles), 2), np.int64)
    )
    key = cells[:, 0] * 100_003 + cells[:, 1]
    order = np.argsort(key, kind="stable")
    triangles, key = triangles[order], key[order]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(key)) + 1])
    corners = points[triangles].astype(np.float64)
    low = np.minimum.reduceat(corners.min(axis=1), starts, axis=0)
    high = np.maximum.reduceat(corners.max(axis=1), starts, axis=0)
    return triangles, Chunks(starts=3 * np.concatenate([starts, [len(key)]]), low=low, high=high)


def visible_runs(chunks: Chunks, planes: FloatArray | None) -> list[tuple[int, int]]:
    """First index and count of what may be seen, neighbours joined.

    >>> box = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    >>> chunks = Chunks(starts=np.array([0, 6, 9]), low=box, high=box + 1.0)
    >>> visible_runs(chunks, None), visible_runs(chunks, np.array([[1.0, 0.0, 0.0, -2.0]]))
    ([(0, 9)], [(6, 3)])
    """
    starts = chunks.starts
    if planes is None:
        return [(0, int(starts[-1]))]
    inside = _inside(chunks, planes)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    return [(int(starts[a]), int(starts[b] - starts[a])) for a, b in edges.reshape(-1, 2).tolist()]


def visible_chunks(chunks: Chunks, planes: FloatArray, eye: FloatArray) -> list[tuple[float, int, int]]:
    """Distance of its box from the eye (m), first index and count of each run that may be seen.

    >>> box = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    >>> chunks = Chunks(starts=np.array([0, 6, 9]), low=box, high=box + 1.0)
    >>> visible_chunks(chunks, np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros(3))
    [(0.0, 0, 6), (5.0, 6, 3)]
    """
    inside = np.flatnonzero(_inside(chunks, planes))
    gap = np.maximum(np.maximum(chunks.low[inside] - eye, eye - chunks.high[inside]), 0.0)
    starts = chunks.starts
    return [
        (float(d), int(starts[k]), int(starts[k + 1] - starts[k]))
        for d, k in zip(np.linalg.norm(gap, axis=1), inside.tolist(), strict=True)
    ]


def _inside(chunks: Chunks, planes: FloatArray) -> npt.NDArray[np.bool_]:
    normals = planes[:, None, :3]
    # Of each box the corner that is farthest along the plane's normal.
    corner = np.where(normals > 0.0, chunks.high, chunks.low)
    return np.asarray(((corner * normals).sum(axis=2) + planes[:, 3:] >= 0.0).all(axis=0))


def texture_of(context: moderngl.Context, material: Material) -> moderngl.Texture:
    """A material's texture with mipmaps. No anisotropic filter: llvmpipe needs seconds a frame for it."""
    height, width = material.image.shape[:2]
    texture = context.texture((width, height), 4, material.image.tobytes())
    texture.build_mipmaps()
    # Between mip levels only the ground is blended, where their borders would show: it costs half as much again.
    blended = material.is_ground or material.is_decal
    texture.filter = (
        context.LINEAR_MIPMAP_LINEAR if blended else context.LINEAR_MIPMAP_NEAREST,
        context.LINEAR,
    )
    texture.repeat_x = texture.repeat_y = not (material.is_cutout or material.is_decal)
    return texture
