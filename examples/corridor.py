"""Draw a robot's run down a corridor and write it as a ROS 2 bag: something to try belie on.

    python examples/corridor.py corridor.mcap

Camera 640x360 at 10 Hz, odometry 50 Hz, IMU 100 Hz, localisation 10 Hz, all with realistic noise; 15 s.
Walls, floor and a few boxes are textured planes, drawn by casting a ray through every pixel; nothing is
downloaded.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import cv2
import numpy as np

from belie.geometry import SE3, CameraModel
from belie.recordings import write_mcap
from belie.types import Claim, Frame, MotionClaim, MountedCamera, PoseClaim, PositionClaim, Step

FRAMES, PERIOD_NS = 150, 100_000_000
MODEL = CameraModel(width=640, height=360, fx=420, fy=420, cx=319.5, cy=179.5)
# camera axes (right, down, forward) in body axes (forward, left, up), 0.3 m ahead and 0.5 m up
CAMERA = MountedCamera(
    model=MODEL, T_body_cam=SE3(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.array([0.3, 0.0, 0.5]))
)


def texture(seed: int, height: int, width: int) -> np.ndarray:
    """Blobs of several sizes: corners for every scale, smooth enough to interpolate."""
    rng = np.random.default_rng(seed)
    image = np.zeros((height, width), np.float32)
    for sigma in (1.5, 4.0, 10.0):
        layer = cv2.GaussianBlur(rng.normal(size=(height, width)).astype(np.float32), (0, 0), sigma)
        image += layer / layer.std()
    return np.clip(128 + 35 * image, 0, 255).astype(np.uint8)


# A corner and two edges of each plane, metres, in world axes (forward, left, up).
PLANES = [
    ((-2, 1.6, -0.1), (42, 0, 0), (0, 0, 2.7)),  # left wall
    ((-2, -1.6, -0.1), (42, 0, 0), (0, 0, 2.7)),  # right wall
    ((-2, -1.6, 0.0), (42, 0, 0), (0, 3.2, 0)),  # floor
    ((-2, -1.6, 2.6), (42, 0, 0), (0, 3.2, 0)),  # ceiling
    ((40, -1.6, 0.0), (0, 3.2, 0), (0, 0, 2.6)),  # far end
    ((14, 0.9, 0.0), (0, 0.7, 0), (0, 0, 0.9)),  # boxes
    ((22, -1.6, 0.0), (0, 0.8, 0), (0, 0, 1.2)),
]


def draw(T_world_cam: SE3, pictures: list[np.ndarray]) -> np.ndarray:
    """The image of one frame."""
    v, u = np.mgrid[0 : MODEL.height, 0 : MODEL.width]
    rays = np.dstack([(u - MODEL.cx) / MODEL.fx, (v - MODEL.cy) / MODEL.fy, np.ones(u.shape)])
    rays = (rays @ T_world_cam.R.T).astype(np.float32)
    nearest = np.full(u.shape, np.inf, np.float32)
    image = np.zeros(u.shape, np.uint8)
    for plane, picture in zip(PLANES, pictures, strict=True):
        corner, a, b = (np.array(x, float) for x in plane)
        normal = np.cross(a, b)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((corner - T_world_cam.t) @ normal) / (rays @ normal)
        hit = T_world_cam.t + rays * depth[..., None] - corner
        s, t = hit @ a / (a @ a), hit @ b / (b @ b)
        seen = (depth > 0.05) & (depth < nearest) & (s >= 0) & (s < 1) & (t >= 0) & (t < 1)
        x, y = (
            (s * (picture.shape[1] - 1)).astype(np.float32),
            (t * (picture.shape[0] - 1)).astype(np.float32),
        )
        image[seen] = cv2.remap(picture, x, y, cv2.INTER_LINEAR)[seen]
        nearest[seen] = depth[seen]
    return image


def body_at(time_s: float) -> SE3:
    """The true pose: 1.5 to 2.5 m/s down the corridor, weaving a little."""
    heading = 0.08 * np.sin(0.7 * time_s)
    R = SE3.exp([0, 0, 0, 0, 0, heading]).R
    return SE3(R, np.array([2.0 * time_s - 0.5 * np.sin(time_s), 0.16 * np.sin(0.7 * time_s - 1.4), 0.0]))


def steps() -> Iterator[Step]:
    """The run, frame by frame, with the claims that came in between."""
    rng = np.random.default_rng(7)
    pictures = [
        texture(i, *(max(64, int(110 * np.linalg.norm(edge))) for edge in (plane[2], plane[1])))
        for i, plane in enumerate(PLANES)
    ]
    T_odom, before = SE3.identity(), body_at(0.0)
    for k in range(FRAMES):
        claims: list[Claim] = []
        for i in range(10 * (k - 1) + 1 if k else 0, 10 * k + 1):  # 100 Hz since the last frame
            now, ns = i * 0.01, i * 10_000_000
            true = body_at(now)
            rate = (body_at(now - 0.005).inverse() @ body_at(now + 0.005)).log() / 0.01
            gyro = rate[3:] + np.radians(0.3) + rng.normal(0, 0.002, 3)
            claims.append(
                MotionClaim(source="/imu", kind="imu", stamp_ns=ns, received_ns=ns, angular_rad_s=gyro)
            )
            if i % 2 == 0:
                step = (before.inverse() @ true).log()
                step[:3] *= 1.003 + rng.normal(0, 0.01, 3)
                T_odom, before = T_odom @ SE3.exp(step), true
                claims.append(
                    PoseClaim(
                        source="/odom", frame_id="odom", stamp_ns=ns, received_ns=ns, T_odom_body=T_odom
                    )
                )
        ns, true = k * PERIOD_NS, body_at(k * 0.1)
        position = true.t + rng.normal(0, 0.03, 3)
        claims.append(
            PositionClaim(
                source="/localization/pose", frame_id="map", kind="localisation", stamp_ns=ns, received_ns=ns,
                position_m=position, covariance=np.eye(3) * 0.03**2,
            )
        )  # fmt: skip
        image = draw(true @ CAMERA.T_body_cam, pictures)
        image = np.clip(image + rng.normal(0, 1.5, image.shape), 0, 255).astype(np.uint8)
        frame = Frame(camera="/camera/image", stamp_ns=ns, received_ns=ns, image=image)
        yield Step(frame=frame, claims=tuple(sorted(claims, key=lambda claim: claim.stamp_ns)))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    write_mcap(
        sys.argv[1], steps(), cameras={"/camera/image": CAMERA}, body_axes="flu", image_encoding="jpeg"
    )
    print(f"wrote {sys.argv[1]}: {FRAMES} frames with odometry, IMU and localisation")
