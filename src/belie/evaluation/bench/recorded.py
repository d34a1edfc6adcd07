"""From a case of the matrix to its recording in memory: rendered or read, with the claims of its seed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from belie.evaluation.bench.cases import RECORDED, DriveCase, RealCase, RecordingCase
from belie.evaluation.bench.made_claims import CAMERA, Drive, Variant, made_recording
from belie.evaluation.bench.memory import MemoryRecording
from belie.evaluation.bench.pictures import Pictures
from belie.geometry import SE3
from belie.recordings import open_recording
from belie.types import DetectionClaim, Frame, MountedCamera, PoseClaim, RecordingError, Step

# Axes x right, y down, z forward in those of a vehicle, x forward, y left, z up.
_R_FLU_RDF = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def load(case: RecordingCase, cache: Path) -> MemoryRecording:
    """The recording of a case.

    Raises
    ------
    RecordingError
        If a recording cannot be read, or holds no poses to make claims from.
    TopicError, CalibrationError
        If of a recording's own streams one is missing or ambiguous, or its camera is not known.
    MissingExtraError
        If it must be rendered, without ``moderngl``.
    """
    if isinstance(case, DriveCase):
        return _drive(case, cache)
    return _as_recorded(case) if case.claims == RECORDED else _real(case)


def _drive(case: DriveCase, cache: Path) -> MemoryRecording:
    pictures = Pictures(scenario=case.scenario, cache=cache)
    pictures.render()
    drive, steps = pictures.steps(case.sensor_seed)
    return MemoryRecording(name=case.name, cameras=drive.cameras, joined=_judged(steps, objects=case.objects))


def _judged(steps: Iterable[Step], *, objects: bool) -> tuple[Step, ...]:
    """All steps; without their detections where these are not judged."""
    if objects:
        return tuple(steps)
    return tuple(
        replace(step, claims=tuple(c for c in step.claims if not isinstance(c, DetectionClaim)))
        for step in steps
    )


def _as_recorded(case: RealCase) -> MemoryRecording:
    """All streams as `belie check` would judge them."""
    recording = open_recording(case.path, **cast("dict[str, Any]", dict(case.streams)))
    return MemoryRecording(
        name=case.name,
        cameras=recording.cameras,
        joined=_judged(recording.steps(), objects=case.objects),
        body_axes=recording.body_axes,
    )


def _real(case: RealCase) -> MemoryRecording:
    drive = real_drive(case.path)
    made = made_recording(drive, cast("Variant", case.claims), case.seed)
    return replace(made, name=case.name)


def real_drive(path: Path) -> Drive:
    """A recording with reference poses, as a drive of a body with x forward, y left, z up."""
    recording = open_recording(path)
    ((_, mounted),) = recording.cameras.items()
    images, stamps_ns, claimed = [], [], list[PoseClaim]()
    for step in recording.steps():
        images.append(step.frame.image)
        stamps_ns.append(step.frame.stamp_ns)
        claimed += [claim for claim in step.claims if isinstance(claim, PoseClaim)]
    if len(claimed) < 2:
        raise RecordingError(f"{path} holds no poses to make claims from")
    turn = SE3(_R_FLU_RDF if recording.body_axes == "rdf" else np.eye(3), np.zeros(3))
    inside = [claimed[0].stamp_ns <= stamp_ns <= claimed[-1].stamp_ns for stamp_ns in stamps_ns]
    kept_ns = [stamp_ns for stamp_ns, is_inside in zip(stamps_ns, inside, strict=True) if is_inside]
    kept = [image for image, is_inside in zip(images, inside, strict=True) if is_inside]
    return Drive(
        name=path.name,
        camera=MountedCamera(model=mounted.model, T_body_cam=turn @ mounted.T_body_cam),
        frames=tuple(
            Frame(camera=CAMERA, stamp_ns=t, received_ns=t, image=image)
            for t, image in zip(kept_ns, kept, strict=True)
        ),
        poses=tuple(turn @ T @ turn.inverse() for T in _at(claimed, kept_ns)),
    )


def _at(claimed: list[PoseClaim], stamps_ns: list[int]) -> list[SE3]:
    """Poses at stamps, interpolated between the claimed ones."""
    known = {claim.stamp_ns: claim.T_odom_body for claim in claimed}
    if all(stamp_ns in known for stamp_ns in stamps_ns):
        return [known[stamp_ns] for stamp_ns in stamps_ns]
    begin = claimed[0].stamp_ns
    times = np.array([claim.stamp_ns - begin for claim in claimed]) * 1e-9
    wanted = (np.array(stamps_ns) - begin) * 1e-9
    R = Slerp(times, Rotation.from_matrix([claim.T_odom_body.R for claim in claimed]))(wanted).as_matrix()
    t = np.column_stack(
        [np.interp(wanted, times, [claim.T_odom_body.t[i] for claim in claimed]) for i in range(3)]
    )
    return [SE3(R[i], t[i]) for i in range(len(wanted))]
