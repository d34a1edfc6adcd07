"""Matrices of the renderer: the camera's, a mirrored one, the sun's, and the planes that bound a view."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from belie.geometry import CameraModel, FloatArray
from belie.simulation.weather import Weather

FAR_M = 1600.0


def projection_matrix(camera: CameraModel, near_m: float, far_m: float = FAR_M) -> FloatArray:
    """OpenGL's projection of a pinhole camera, shape (4, 4): camera axes x right, y down, z forward.

    The first row of the buffer is the first row of the picture, so nothing needs to be flipped. OpenGL counts from the
    image's corner, OpenCV from the middle of the first pixel: half a pixel apart.

    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> clip = projection_matrix(camera, 0.1) @ [0.0, 0.0, 5.0, 1.0]
    >>> (clip[:2] / clip[3]).tolist()
    [0.0, 0.0]
    """
    w, h = camera.width, camera.height
    P = np.zeros((4, 4))
    P[0, 0], P[0, 2] = 2.0 * camera.fx / w, (2.0 * camera.cx + 1.0) / w - 1.0
    P[1, 1], P[1, 2] = 2.0 * camera.fy / h, (2.0 * camera.cy + 1.0) / h - 1.0
    P[2, 2], P[2, 3] = (far_m + near_m) / (far_m - near_m), -2.0 * far_m * near_m / (far_m - near_m)
    P[3, 2] = 1.0
    return P


def ideal_camera(camera: CameraModel) -> CameraModel:
    """The pinhole camera that sees all that a lens with distortion sees; itself if there is none.

    >>> lens = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5, model="radial_tangential",
    ...                    distortion=(-0.12, 0.03, 0.0, 0.0))
    >>> ideal_camera(lens).width > 640
    True
    """
    if not camera.is_distorted:
        return camera
    x, y = np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64)
    border = np.concatenate(
        [
            np.column_stack([x, np.zeros_like(x)]),
            np.column_stack([x, np.full_like(x, camera.height - 1.0)]),
            np.column_stack([np.zeros_like(y), y]),
            np.column_stack([np.full_like(y, camera.width - 1.0), y]),
        ]
    )
    flat = camera.normalize(border) * (camera.fx, camera.fy)
    low, high = np.floor(flat.min(axis=0)) - 2.0, np.ceil(flat.max(axis=0)) + 2.0
    width, height = (int(v) for v in high - low + 1.0)
    return replace(
        camera,
        width=width,
        height=height,
        cx=float(-low[0]),
        cy=float(-low[1]),
        model="pinhole",
        distortion=(),
    )


def mirrored(T_cam_world: FloatArray) -> FloatArray:
    """View (4, 4) of the world mirrored in the plane z = 0."""
    return np.asarray(T_cam_world @ np.diag([1.0, 1.0, -1.0, 1.0]))


def frustum_planes(
    view_projection: FloatArray, reach_m: float, eye: FloatArray, forward: FloatArray
) -> FloatArray:
    """Planes (6, 4) with the view on their positive side; the last stands at `reach_m`."""
    rows = view_projection
    sides = [rows[3] + rows[0], rows[3] - rows[0], rows[3] + rows[1], rows[3] - rows[1], rows[3] + rows[2]]
    end = np.array([*(-forward), float(forward @ eye) + reach_m])
    return np.array([*sides, end])


def sun_direction(weather: Weather, street_direction_rad: float) -> FloatArray:
    """Unit vector towards the sun, world."""
    azimuth = street_direction_rad + math.radians(weather.sun_azimuth_deg)
    elevation = math.radians(weather.sun_elevation_deg)
    across = math.cos(elevation)
    return np.array([across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)])


def sun_projection(towards_sun: FloatArray, middle: FloatArray, reach_m: float, texels: int) -> FloatArray:
    """Orthographic view (4, 4) from the sun onto what lies within `reach_m` of `middle`.

    The middle is rounded to whole texels, so that shadows do not crawl when the view moves.
    """
    z = -towards_sun
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    R = np.array([x, y, z])
    texel_m = 2.0 * reach_m / texels
    at = R @ middle
    at[:2] = np.round(at[:2] / texel_m) * texel_m
    deep = 2.5 * reach_m
    M = np.eye(4)
    M[:2, :3] = R[:2] / reach_m
    M[2, :3] = R[2] / deep
    M[:2, 3] = -at[:2] / reach_m
    M[2, 3] = -round(float(at[2])) / deep
    return M


def picture_rays(camera: CameraModel, R: FloatArray) -> FloatArray:
    """Maps OpenGL's picture coordinates (-1 to 1, -1 to 1, 1) to rays turned by R, shape (3, 3).

    >>> camera = CameraModel(width=640, height=480, fx=320, fy=320, cx=319.5, cy=239.5)
    >>> (picture_rays(camera, np.eye(3)) @ [1.0, 0.0, 1.0]).tolist()
    [1.0, 0.0, 1.0]
    """
    c = camera
    inverse = np.array(
        [
            [0.5 * c.width / c.fx, 0.0, (0.5 * c.width - 0.5 - c.cx) / c.fx],
            [0.0, 0.5 * c.height / c.fy, (0.5 * c.height - 0.5 - c.cy) / c.fy],
            [0.0, 0.0, 1.0],
        ]
    )
    return np.asarray(R @ inverse)


def sight_m(weather: Weather) -> float:
    """How far one sees: in fog, until less than a level of contrast is left.

    >>> from belie.simulation.weather import WEATHERS
    >>> round(sight_m(WEATHERS["heavy-fog"])), sight_m(WEATHERS["sunny"]) == FAR_M
    (90, True)
    """
    extinction = weather.extinction_per_m
    return min(FAR_M, 6.0 / extinction) if extinction > 0.0 else FAR_M
