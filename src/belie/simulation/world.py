"""What a simulated world is made of: materials, meshes, actors, lamps, and the robot's way through it.

Frames: ``world`` x east, y north, z up; ``body`` (`base_link`) x forward, y left, z up; camera x right, y down, z
forward. Metres throughout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray
from belie.simulation.motion import Motion
from belie.types import frozen, frozen_as

Colour = tuple[float, float, float]
Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Material:
    """How a surface looks.

    Parameters
    ----------
    image : array (H, W, 4), uint8, RGBA
        Its texture, repeated. Alpha is how much it glows by itself at night; of a cut-out it is the opacity.
    gloss : float
        0 dull, 1 like glass.
    is_cutout : bool
        Whether alpha is opacity: leaves, railings.
    is_decal : bool
        Whether it is thin and lies on the surface right below, with alpha as opacity: marks, cracks, stains. It belongs
        to that surface: no depth of its own.
    is_ground : bool
        Whether rain makes puddles on it.
    is_double_sided : bool
        Whether light falls on both sides, as on leaves.
    glow : float
        How much it shines by day too: screens, ceiling lights.
    seen_m : float
        Beyond this distance it is left out: details that would be less than a pixel wide.
    """

    image: Picture
    gloss: float = 0.0
    is_cutout: bool = False
    is_decal: bool = False
    is_ground: bool = False
    is_double_sided: bool = False
    glow: float = 0.0
    seen_m: float = 1e9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Triangles of one material.

    Parameters
    ----------
    points, normals : array (N, 3), float32
        Metres; of an actor in its own frame, else world.
    uv : array (N, 2), float32
        Texture coordinates, 1 is once the texture.
    colours : array (N, 4), uint8
        Tint, and in alpha how much of the sky the vertex sees (255: all of it).
    triangles : array (M, 3), int32
        Indices of points.
    material : Material
        Of all of them.
    """

    points: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    uv: npt.NDArray[np.float32]
    colours: npt.NDArray[np.uint8]
    triangles: npt.NDArray[np.int32]
    material: Material

    def __post_init__(self) -> None:
        n = len(self.points)
        for name, width, dtype in (
            ("points", 3, np.float32),
            ("normals", 3, np.float32),
            ("uv", 2, np.float32),
            ("colours", 4, np.uint8),
            ("triangles", 3, np.int32),
        ):
            object.__setattr__(self, name, frozen_as(getattr(self, name), (-1, width), name, dtype))
        if not len(self.normals) == len(self.uv) == len(self.colours) == n:
            raise ValueError("a mesh needs as many normals, uv and colours as points")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """A rigid piece of an actor: its trunk, a wheel, a leg.

    Parameters
    ----------
    meshes : tuple of Mesh
        In the actor's frame.
    pivot_m : array (3,)
        About the y axis through here it rolls and swings.
    rolling_radius_m : float
        Of a wheel; 0 does not roll.
    swing_rad, stride_m, phase_rad : float
        Of a leg or arm: how far it swings, over which way to and fro, and when.
    shown_s : tuple of (float, float)
        Spans of time in which it is there; empty: always. For the lamps of a traffic light.
    is_mount : bool
        It only carries the actor, as the post does a sign: drawn, but within no label. Data sets (BDD100K, COCO) and
        the detectors trained on them box the sign or the lights alone.
    """

    meshes: tuple[Mesh, ...]
    pivot_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rolling_radius_m: float = 0.0
    swing_rad: float = 0.0
    stride_m: float = 1.4
    phase_rad: float = 0.0
    shown_s: tuple[tuple[float, float], ...] = ()
    is_mount: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Glow:
    """A light that is seen as such at night: a lamp of a vehicle or a street.

    Parameters
    ----------
    position_m : tuple of float
        Of an actor in its frame, else world.
    colour : tuple of float
        Red, green, blue; 1 is bright.
    radius_m : float
        Of its halo.
    facing : tuple of float
        Where it shines to; zero: everywhere.
    """

    position_m: tuple[float, float, float]
    colour: Colour
    radius_m: float
    facing: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Actor:
    """A thing with an identity: vehicles and people, and also signs, traffic lights and doors.

    Parameters
    ----------
    id : int
        Its own, greater than 0.
    label : str
        Its class: car, van, truck, bus, pedestrian, stop sign, speed sign, traffic light, door.
    dimensions_m : tuple of float
        Length (x), width (y), height (z) of its box. The box stands on the actor's origin: x and y from -half to half,
        z from `base_m` up.
    motion : Motion
        Moves its frame.
    parts : tuple of Part
        Its shape.
    base_m : float
        Height of the underside of its box over its origin.
    glows : tuple of Glow
        Its lights.
    is_patched : bool
        Whether it bears an adversarial patch.
    """

    id: int
    label: str
    dimensions_m: tuple[float, float, float]
    motion: Motion
    parts: tuple[Part, ...]
    base_m: float = 0.0
    glows: tuple[Glow, ...] = ()
    is_patched: bool = False

    def __post_init__(self) -> None:
        if self.id < 1:
            raise ValueError(f"an actor's id is at least 1, got {self.id}")

    def T_world_box(self, t_s: float) -> SE3:
        """Pose of the middle of its box."""
        up = SE3.from_translation([0.0, 0.0, self.base_m + 0.5 * self.dimensions_m[2]])
        return self.motion.T_world_body(t_s) @ up


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lane:
    """The lane that the robot should keep.

    Parameters
    ----------
    centre_m : array (N, 3)
        Its middle, world, in the order of travel.
    half_width_m : float
        From the middle to the marks.
    speed_m_s : float
        What one drives on it.
    """

    centre_m: FloatArray
    half_width_m: float
    speed_m_s: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre_m", frozen(self.centre_m, (-1, 3), "centre_m"))


def _flat(x_m: float, y_m: float) -> float:
    return 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class World:
    """Everything that there is.

    Parameters
    ----------
    static : tuple of Mesh
        What never moves.
    actors : tuple of Actor
        What has an identity.
    ego : Motion
        The robot's own, undisturbed by any attack; its frame `body` is on the ground below the rear axle of a car,
        below the middle of other robots on wheels, in the middle of a drone.
    T_body_cam : SE3
        Where the camera sits.
    lane : Lane
        For a controller.
    glows : tuple of Glow
        Street lamps and the like.
    lamps : array (N, 4)
        Places (x, y, z) of lamps that light their surroundings at night, and their strengths.
    ground_height_m : callable
        Height of the ground over x and y.
    is_indoors : bool
        No sky, no rain; lamps burn by day.
    has_flat_ground : bool
        Whether the ground is the plane z = 0, which can mirror when it is wet.
    shadow_reach_m : float
        How far from the camera the sun's shadows are drawn.
    headlights_m : array (3,), optional
        Place of the robot's headlights, body; None: it has none.
    headlight_power : float
        Their strength; a car's is 1.5.
    street_direction_rad : float
        World azimuth in which one looks mostly: a low sun stands there.
    """

    static: tuple[Mesh, ...]
    actors: tuple[Actor, ...]
    ego: Motion
    T_body_cam: SE3
    lane: Lane
    glows: tuple[Glow, ...] = ()
    lamps: FloatArray
    ground_height_m: Callable[[float, float], float] = _flat
    is_indoors: bool = False
    has_flat_ground: bool = True
    shadow_reach_m: float = 110.0
    headlights_m: tuple[float, float, float] | None = (3.6, 0.0, 0.7)
    headlight_power: float = 1.5
    street_direction_rad: float = 0.0

    @property
    def near_m(self) -> float:
        """What is nearer to the camera is not drawn."""
        return 0.05 if self.is_indoors else 0.2

    def __post_init__(self) -> None:
        object.__setattr__(self, "lamps", frozen(self.lamps, (-1, 4), "lamps"))
        ids = [actor.id for actor in self.actors]
        if len(set(ids)) != len(ids):
            raise ValueError("two actors have the same id")
