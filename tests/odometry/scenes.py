"""A textured wall and box room seen by a pinhole camera: images whose motion is known exactly."""

import cv2
import numpy as np

from belie.geometry import SE3, CameraModel

CAMERA = CameraModel(width=480, height=320, fx=300, fy=300, cx=239.5, cy=159.5)


def texture(seed: int, size: int = 900) -> np.ndarray:
    """Blobs of several sizes: corners at every pyramid level, smooth enough to interpolate."""
    rng = np.random.default_rng(seed)
    image = np.zeros((size, size), np.float32)
    for sigma in (2.0, 5.0, 12.0):
        layer = cv2.GaussianBlur(rng.normal(size=(size, size)).astype(np.float32), (0, 0), sigma)
        image += layer / layer.std()
    return np.clip(128 + 40 * image, 0, 255).astype(np.uint8)


_PLANES = [  # origin, two edges (metres): back wall, floor, left wall, a box in front
    ((-4.0, -3.0, 9.0), (8.0, 0.0, 0.0), (0.0, 5.0, 0.0)),
    ((-4.0, 1.5, 1.5), (8.0, 0.0, 0.0), (0.0, 0.0, 8.0)),
    ((-3.5, -3.0, 1.5), (0.0, 0.0, 8.0), (0.0, 5.0, 0.0)),
    ((0.5, -0.5, 5.0), (1.5, 0.0, 0.0), (0.0, 2.0, 0.0)),
]
_TEXTURES = [texture(i) for i in range(len(_PLANES))]


def render(T_world_cam: SE3, camera: CameraModel = CAMERA) -> np.ndarray:
    """What the camera sees of the room, by casting a ray through every pixel centre."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    rays = np.dstack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])
    rays = rays @ T_world_cam.R.T
    nearest = np.full(u.shape, np.inf)
    image = np.full(u.shape, 20, np.uint8)
    for plane, picture in zip(_PLANES, _TEXTURES, strict=True):
        o, a, b = (np.array(v) for v in plane)
        normal = np.cross(a, b)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((o - T_world_cam.t) @ normal) / (rays @ normal)
        hit = T_world_cam.t + rays * depth[..., None] - o
        s, t = hit @ a / (a @ a), hit @ b / (b @ b)
        seen = (depth > 0.1) & (depth < nearest) & (s >= 0) & (s < 1) & (t >= 0) & (t < 1)
        scale = picture.shape[0] - 1
        sampled = cv2.remap(
            picture, (s * scale).astype(np.float32), (t * scale).astype(np.float32), cv2.INTER_LINEAR
        )
        image[seen] = sampled[seen]
        nearest[seen] = depth[seen]
    return image
