import numpy as np
import pytest

from belie.simulation.meshes.builder import Builder
from belie.simulation.meshes.vehicle_bodies import BODIES, PAINTS
from belie.simulation.meshes.vehicles import vehicle_parts
from belie.simulation.textures.noise import fbm
from belie.simulation.textures.walls import brick
from belie.simulation.world import Material


def test_noise_tiles():
    noise = fbm(64, 3).astype(float)
    steps = np.abs(np.diff(noise, axis=1)).mean()
    seam = np.abs(noise[:, 0] - noise[:, -1]).mean()
    assert seam < 2.0 * steps


def test_textures_are_the_same_every_time():
    brick.cache_clear()
    first = brick(2).copy()
    brick.cache_clear()
    assert np.array_equal(first, brick(2))


@pytest.mark.parametrize("kind", sorted(BODIES))
def test_a_vehicle_looks_outwards(kind):
    """Triangles of the bodywork are wound as their normals say, and most normals point away from the middle."""
    outward = total = 0
    for mesh in vehicle_parts(kind, PAINTS[0], 1)[0].meshes:
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal, axis=1)
        agrees = (normal * mesh.normals[mesh.triangles].sum(axis=1)).sum(axis=1)
        assert (agrees[size > 1e-9] >= 0.0).all()
        middle = np.array([0.0, 0.0, 0.5 * BODIES[kind].dimensions_m[2]])
        outward += size[((a + b + c) / 3.0 - middle)[:, 1] * normal[:, 1] >= 0.0].sum()
        total += size.sum()
    assert outward > 0.9 * total


def test_a_box_faces_outwards():
    builder = Builder()
    builder.box(Material(image=np.zeros((2, 2, 4), np.uint8)), (1.0, 2.0, 3.0), (1.0, 2.0, 3.0))
    (mesh,) = builder.meshes()
    assert ((mesh.points - [1.0, 2.0, 3.0]) * mesh.normals).sum(axis=1).min() > 0.4
