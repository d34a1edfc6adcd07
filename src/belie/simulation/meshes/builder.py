"""Collects faces by material and makes meshes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray
from belie.simulation.world import Colour, Material, Mesh

WHITE: Colour = (1.0, 1.0, 1.0)
_QUAD = np.array([[0, 1, 2], [0, 2, 3]])
_UNIT_UV = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])


def _box_template() -> tuple[
    FloatArray, FloatArray, FloatArray, npt.NDArray[np.int64], npt.NDArray[np.int64]
]:
    """Corners (24, 3), normals, uv, the axes that uv run along, and triangles of a box from -1 to 1."""
    corners, normals, sides = [], [], []
    for axis in range(3):
        u, v = ((1, 2), (0, 2), (0, 1))[axis]  # v is upright where it can be
        for sign in (-1.0, 1.0):
            face = np.zeros((4, 3))
            face[:, axis] = sign
            face[:, u] = (sign if axis != 1 else -sign) * np.array([-1.0, 1.0, 1.0, -1.0])
            face[:, v] = [-1.0, -1.0, 1.0, 1.0]
            normal = np.zeros(3)
            normal[axis] = sign
            corners.append(face)
            normals.append(np.tile(normal, (4, 1)))
            sides.append(np.tile([u, v], (4, 1)))
    first = 4 * np.arange(6)[:, None]
    triangles = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return (
        np.concatenate(corners),
        np.concatenate(normals),
        np.tile(_UNIT_UV, (6, 1)),
        np.concatenate(sides),
        triangles,
    )


_BOX_CORNERS, _BOX_NORMALS, _BOX_UV, _BOX_SIDES, _BOX_TRIANGLES = _box_template()


class Builder:
    """Faces, material by material; what is added lies in the frame `T` (by default the world's or the actor's own).

    Examples
    --------
    >>> stone = Material(image=np.full((2, 2, 4), 128, np.uint8))
    >>> builder = Builder()
    >>> builder.box(stone, (0.0, 0.0, 0.0), (2.0, 1.0, 1.0))
    >>> mesh, = builder.meshes()
    >>> len(mesh.points), mesh.points.min(axis=0)
    (24, array([-1. , -0.5, -0.5], dtype=float32))
    """

    def __init__(self) -> None:
        self.T = SE3.identity()
        self._faces: dict[
            Material, list[tuple[FloatArray, FloatArray, FloatArray, FloatArray, npt.NDArray[np.int64]]]
        ] = {}

    def surface(
        self,
        material: Material,
        points: npt.ArrayLike,
        normals: npt.ArrayLike,
        uv: npt.ArrayLike,
        triangles: npt.ArrayLike,
        colour: Colour = WHITE,
        sky: npt.ArrayLike = 1.0,
    ) -> None:
        """Add any triangles; `sky` is how much of it each point sees, 0 to 1."""
        p, n = np.asarray(points, np.float64), np.asarray(normals, np.float64)
        tint = np.empty((len(p), 4))
        tint[:, :3] = colour
        tint[:, 3] = sky
        entry = (
            self.T.apply(p),
            n @ self.T.R.T,
            np.asarray(uv, np.float64),
            tint,
            np.asarray(triangles, np.int64),
        )
        self._faces.setdefault(material, []).append(entry)

    def quad(
        self,
        material: Material,
        corners: npt.ArrayLike,
        uv: npt.ArrayLike = _UNIT_UV,
        colour: Colour = WHITE,
        sky: npt.ArrayLike = 1.0,
    ) -> None:
        """Add a flat face: corners (4, 3) anticlockwise as seen from outside, from its lower left."""
        c = np.asarray(corners, np.float64)
        # By hand: np.cross costs more than all else here, and a street has ten thousand faces.
        (ax, ay, az), (bx, by, bz) = (c[1] - c[0]).tolist(), (c[3] - c[0]).tolist()
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        length = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
        normal = np.array([nx / length, ny / length, nz / length])
        self.surface(material, c, np.broadcast_to(normal, (4, 3)), uv, _QUAD, colour, sky)

    def box(
        self,
        material: Material,
        middle: Sequence[float],
        size: Sequence[float],
        colour: Colour = WHITE,
        tile_m: float = 0.0,
        sky_below: float = 1.0,
    ) -> None:
        """Add a box; its texture is repeated every `tile_m`, or lies once on each side."""
        half, centre = 0.5 * np.asarray(size, np.float64), np.asarray(middle, np.float64)
        points = centre + _BOX_CORNERS * half
        uv = _BOX_UV * (2.0 * half[_BOX_SIDES] / tile_m) if tile_m else _BOX_UV
        sky = np.where(_BOX_CORNERS[:, 2] < 0.0, sky_below, 1.0)
        self.surface(material, points, _BOX_NORMALS, uv, _BOX_TRIANGLES, colour, sky)

    def tube(
        self,
        material: Material,
        foot: Sequence[float],
        top: Sequence[float],
        radii: tuple[float, float],
        colour: Colour = WHITE,
        sides: int = 10,
        repeats: tuple[float, float] = (1.0, 1.0),
        sky_foot: float = 1.0,
    ) -> None:
        """Add a cone or cylinder without ends."""
        a, b = np.asarray(foot, np.float64), np.asarray(top, np.float64)
        axis = (b - a) / float(np.linalg.norm(b - a))
        helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        u = np.cross(axis, helper)
        u /= np.linalg.norm(u)
        v = np.cross(axis, u)
        angles = np.linspace(0.0, 2.0 * np.pi, sides + 1)
        ring = np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v
        points = np.concatenate([a + radii[0] * ring, b + radii[1] * ring])
        along = np.linspace(0.0, repeats[0], sides + 1)
        uv = np.concatenate(
            [np.column_stack([along, along * 0 + repeats[1]]), np.column_stack([along, along * 0])]
        )
        i = np.arange(sides)
        lower, upper = i, i + sides + 1
        triangles = np.concatenate(
            [np.column_stack([lower, lower + 1, upper + 1]), np.column_stack([lower, upper + 1, upper])]
        )
        sky = np.concatenate([np.full(sides + 1, sky_foot), np.ones(sides + 1)])
        self.surface(material, points, np.tile(ring, (2, 1)), uv, triangles, colour, sky)

    def disc(
        self,
        material: Material,
        middle: Sequence[float],
        normal: Sequence[float],
        radius: float,
        colour: Colour = WHITE,
    ) -> None:
        """Add a disc of twenty corners that shows the texture once; x or y of its normal is 1 or -1."""
        n = np.asarray(normal, np.float64)
        up = np.array([0.0, 0.0, 1.0]) if abs(n[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
        right = np.cross(up, n)
        angles = np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False)
        c, s = np.cos(angles), np.sin(angles)
        points = np.asarray(middle, np.float64) + radius * (c[:, None] * right + s[:, None] * up)
        uv = np.column_stack([0.5 + 0.5 * c, 0.5 - 0.5 * s])
        triangles = [[0, k, k + 1] for k in range(1, 19)]
        self.surface(material, points, np.tile(n, (20, 1)), uv, triangles, colour)

    def grid(
        self,
        material: Material,
        points: FloatArray,
        uv: FloatArray,
        colour: Colour = WHITE,
        sky: npt.ArrayLike = 1.0,
    ) -> None:
        """Add a bent sheet: points (R, C, 3) and uv (R, C, 2); smooth, its outside where rows × columns points to."""
        rows, columns = points.shape[:2]
        du, dv = np.gradient(points, axis=1), np.gradient(points, axis=0)
        normals = np.cross(du, dv)
        normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
        r, c = np.mgrid[0 : rows - 1, 0 : columns - 1]
        a = (r * columns + c).ravel()
        triangles = np.concatenate(
            [np.column_stack([a, a + 1, a + columns + 1]), np.column_stack([a, a + columns + 1, a + columns])]
        )
        seen = np.broadcast_to(sky, points.shape[:2]).reshape(-1)
        self.surface(
            material,
            points.reshape(-1, 3),
            normals.reshape(-1, 3),
            uv.reshape(-1, 2),
            triangles,
            colour,
            seen,
        )

    def contact(self, material: Material, size: tuple[float, float]) -> None:
        """Add the darkness below a body of a length and width that stands on the origin."""
        x, y, z = 0.5 * size[0], 0.5 * size[1], 0.02
        self.quad(material, [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])

    def meshes(self) -> tuple[Mesh, ...]:
        """One mesh for each material."""
        return tuple(_joined(material, entries) for material, entries in self._faces.items())


def _joined(material: Material, entries: Sequence[tuple[npt.NDArray[np.generic], ...]]) -> Mesh:
    counts = np.cumsum([0] + [len(entry[0]) for entry in entries])
    points, normals, uv, tint = (np.concatenate([entry[k] for entry in entries]) for k in range(4))
    triangles = np.concatenate([entry[4] + start for entry, start in zip(entries, counts[:-1], strict=True)])
    # Wind each triangle as its normals say, so that backs can be left out.
    a, b, c = (points[triangles[:, k]] for k in range(3))
    facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), normals[triangles].sum(axis=1))
    triangles[facing < 0.0] = triangles[facing < 0.0][:, ::-1]
    return Mesh(
        points=points.astype(np.float32),
        normals=normals.astype(np.float32),
        uv=uv.astype(np.float32),
        colours=(np.clip(tint, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8),
        triangles=triangles.astype(np.int32),
        material=material,
    )
