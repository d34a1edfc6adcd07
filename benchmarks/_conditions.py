"""Settings that nothing was tuned on: other baselines, sizes, lenses, light, blur, mounts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from _recordings import Drive
from belie.geometry import SE3, CameraModel

Image = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A change of a drive: of its frames, its camera, its mount."""

    name: str
    change: Callable[[Drive, np.random.Generator], Drive]


def _every(step: int) -> Callable[[Drive, np.random.Generator], Drive]:
    def change(source: Drive, _: np.random.Generator) -> Drive:
        return replace(source, frames=source.frames[::step], poses=source.poses[::step])

    return change


def _dropped(source: Drive, rng: np.random.Generator) -> Drive:
    kept = np.flatnonzero(rng.random(len(source.frames)) >= 0.2)
    return replace(
        source,
        frames=tuple(source.frames[i] for i in kept),
        poses=tuple(source.poses[i] for i in kept),
    )


def _resized(factor: float) -> Callable[[Drive, np.random.Generator], Drive]:
    def change(source: Drive, _: np.random.Generator) -> Drive:
        model = source.camera.model.scaled(factor)
        # An odd side does not halve: the camera is that of the size that comes out.
        across, down = model.width / source.camera.model.width, model.height / source.camera.model.height
        whole = source.camera.model
        model = replace(
            model,
            fx=whole.fx * across,
            fy=whole.fy * down,
            cx=(whole.cx + 0.5) * across - 0.5,
            cy=(whole.cy + 0.5) * down - 0.5,
        )
        size = (model.width, model.height)
        return _with(source, model, lambda image: cv2.resize(image, size, interpolation=cv2.INTER_AREA))

    return change


def _cropped(source: Drive, _: np.random.Generator) -> Drive:
    """The central 60 % of each side: the lens of a longer focal length."""
    return _cut(source, 0.2 * source.camera.model.width, 0.2 * source.camera.model.height)


def _cut(source: Drive, left: float, top: float) -> Drive:
    whole, x, y = source.camera.model, round(left), round(top)
    model = replace(
        whole, width=whole.width - 2 * x, height=whole.height - 2 * y, cx=whole.cx - x, cy=whole.cy - y
    )
    rows, columns = slice(y, y + model.height), slice(x, x + model.width)
    return _with(source, model, lambda image: np.ascontiguousarray(image[rows, columns]))


def _exposed(source: Drive, rng: np.random.Generator) -> Drive:
    """Every 15 frames or so another gain, x0.6 to x1.6, and another gamma, 0.7 to 1.4."""
    levels = np.arange(256.0)
    table = levels.astype(np.uint8)
    frames = []
    for frame in source.frames:
        if rng.random() < 1.0 / 15.0:
            gain, gamma = rng.uniform(0.6, 1.6), rng.uniform(0.7, 1.4)
            table = np.clip(np.rint(255.0 * (levels / 255.0) ** gamma * gain), 0, 255).astype(np.uint8)
        frames.append(replace(frame, image=cv2.LUT(frame.image, table)))
    return replace(source, frames=tuple(frames))


def _blurred(source: Drive, rng: np.random.Generator) -> Drive:
    """A streak of 9 px, in a direction that swings from frame to frame."""
    angle, frames = 0.0, []
    for frame in source.frames:
        angle += 0.2 * rng.standard_normal()
        kernel = np.zeros((9, 9), dtype=np.uint8)
        reach = 4.0 * np.array([np.cos(angle), np.sin(angle)])
        ends = np.rint([4.0 - reach, 4.0 + reach]).astype(int)
        cv2.line(kernel, tuple(ends[0].tolist()), tuple(ends[1].tolist()), 1)
        image = cv2.filter2D(frame.image, -1, kernel / float(kernel.sum()))
        frames.append(replace(frame, image=image))
    return replace(source, frames=tuple(frames))


def _rolled(*, told: bool) -> Callable[[Drive, np.random.Generator], Drive]:
    """The camera rolled by 5 degrees about its axis; the mount says so, or does not."""

    def change(source: Drive, _: np.random.Generator) -> Drive:
        model = source.camera.model
        cosine, sine = np.cos(np.radians(5.0)), np.sin(np.radians(5.0))
        R_rolled_cam = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        K = model.K
        # About the optical axis, as a real camera turns: distortion and intrinsics stay.
        turn = (K @ R_rolled_cam @ np.linalg.inv(K))[:2]
        size = (model.width, model.height)
        turned = _with(source, model, lambda image: cv2.warpAffine(image, turn, size, flags=cv2.INTER_CUBIC))
        # What the turned image does not fill is cut off.
        inside = _cut(turned, sine * model.height / 2 + 8, sine * model.width / 2 + 8)
        T_cam_rolled = SE3(R_rolled_cam.T, np.zeros(3))
        mount = source.camera.T_body_cam @ T_cam_rolled if told else source.camera.T_body_cam
        return replace(inside, camera=replace(inside.camera, T_body_cam=mount))

    return change


def _noisy(source: Drive, rng: np.random.Generator) -> Drive:
    def change(image: Image) -> npt.NDArray[np.floating]:
        return image + 5.0 * rng.standard_normal(image.shape)

    return _with(source, source.camera.model, lambda image: np.clip(np.rint(change(image)), 0, 255))


def _compressed(source: Drive, _: np.random.Generator) -> Drive:
    def change(image: Image) -> npt.NDArray[np.generic]:
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 50])[1]
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))

    return _with(source, source.camera.model, change)


def _with(source: Drive, model: CameraModel, change: Callable[[Image], npt.NDArray[np.generic]]) -> Drive:
    frames = tuple(
        replace(frame, image=np.asarray(change(frame.image), dtype=np.uint8)) for frame in source.frames
    )
    return replace(source, camera=replace(source.camera, model=model), frames=frames)


CONDITIONS = (
    Condition(name="as recorded", change=lambda source, _: source),
    Condition(name="every 2nd frame", change=_every(2)),
    Condition(name="every 3rd frame", change=_every(3)),
    Condition(name="half resolution", change=_resized(0.5)),
    Condition(name="quarter resolution", change=_resized(0.25)),
    Condition(name="central crop 60 %", change=_cropped),
    Condition(name="20 % of frames dropped", change=_dropped),
    Condition(name="exposure jumps", change=_exposed),
    Condition(name="motion blur 9 px", change=_blurred),
    Condition(name="roll 5 deg, told", change=_rolled(told=True)),
    Condition(name="roll 5 deg, not told", change=_rolled(told=False)),
    Condition(name="sensor noise 5", change=_noisy),
    Condition(name="JPEG quality 50", change=_compressed),
)
