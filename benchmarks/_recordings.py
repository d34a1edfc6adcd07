"""Recordings in memory, with the claims that a robot would make on them; see `belie.evaluation.bench.made_claims`."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from belie.evaluation.bench.made_claims import (
    CAMERA,
    GNSS,
    IMU,
    LOCALISATION,
    ODOMETRY,
    VARIANTS,
    Drive,
    Variant,
    made_recording,
)
from belie.evaluation.bench.memory import MemoryRecording
from belie.geometry import SE3, CameraModel
from belie.recordings import open_recording
from belie.types import Frame, MountedCamera, PoseClaim

__all__ = [
    "CAMERA",
    "GNSS",
    "IMU",
    "LOCALISATION",
    "ODOMETRY",
    "RECORDINGS",
    "R_BODY_CAM",
    "VARIANTS",
    "Drive",
    "MemoryRecording",
    "Variant",
    "data_folder",
    "drive",
    "made_recording",
]

RECORDINGS = ("kitti00", "kitti06", "handheld")
# Camera axes (x right, y down, z forward) in the body's.
R_BODY_CAM = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def data_folder() -> Path:
    """Where the recordings lie: BELIE_DATA, or ``shared/data`` beside the checkout."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("BELIE_DATA", beside))
    if not folder.is_dir():
        raise SystemExit(f"no recordings at {folder}: set BELIE_DATA to the folder that holds kitti00")
    return folder


@cache
def drive(name: str) -> Drive:
    """One of `RECORDINGS`, read from the disk once."""
    folder = data_folder() / name
    T_body_cam = SE3(R_BODY_CAM, np.zeros(3))
    if name == "handheld":
        model, images, stamps_ns, T_world_cam = _handheld(folder)
        R_odom_world = np.diag([1.0, -1.0, -1.0])  # the board's z points into the desk
    else:
        recording = open_recording(folder)
        ((_, mounted),) = recording.cameras.items()
        model, T_world_cam, images, stamps_ns = mounted.model, [], [], []
        for step in recording.steps():
            images.append(step.frame.image)
            stamps_ns.append(step.frame.stamp_ns)
            T_world_cam += [c.T_odom_body for c in step.claims if isinstance(c, PoseClaim)]
        R_odom_world = R_BODY_CAM
    T_odom_world = SE3(R_odom_world, np.zeros(3))
    return Drive(
        name=name,
        camera=MountedCamera(model=model, T_body_cam=T_body_cam),
        frames=tuple(
            Frame(camera=CAMERA, stamp_ns=t, received_ns=t, image=image)
            for t, image in zip(stamps_ns, images, strict=True)
        ),
        poses=tuple(T_odom_world @ T @ T_body_cam.inverse() for T in T_world_cam),
    )


def _handheld(folder: Path) -> tuple[CameraModel, list[npt.NDArray[np.uint8]], list[int], list[SE3]]:
    K = np.loadtxt(folder / "K.txt")
    files = sorted((folder / "images").glob("*.jpg"))
    images = [np.asarray(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE), dtype=np.uint8) for file in files]
    height, width = images[0].shape
    model = CameraModel(
        width=width, height=height, fx=K[0, 0], fy=K[1, 1], cx=K[0, 2], cy=K[1, 2],
        model="radial_tangential", distortion=(-0.29660776, 0.08081684, 0.0, 0.0),
    )  # fmt: skip
    rows = np.loadtxt(folder / "poses.txt")
    T_world_cam = [SE3(cv2.Rodrigues(row[:3])[0], row[3:]).inverse() for row in rows]
    stamps_ns = [round(i * 1e9 / 30.0) for i in range(len(files))]
    return model, images, stamps_ns, T_world_cam[: len(files)]
