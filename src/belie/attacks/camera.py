"""Attacks on the camera: the image lies, its stamp stays honest."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from typing import Protocol

import cv2
import numpy as np

from belie.attacks.plan import Plan
from belie.attacks.stream import Upstream, reading
from belie.types import Frame, GrayImage, Step


class Past(Protocol):
    """Images that were sent before."""

    def image(self, camera: str, stamp_ns: int, fallback: Frame) -> GrayImage:
        """The newest image of `camera` stamped up to `stamp_ns`; stamps must not decrease between calls."""
        ...


def camera_steps(plan: Plan, upstream: Upstream) -> Iterator[Step]:
    """The steps of `upstream` with the images of the attacked frames forged."""
    with reading(upstream) as steps, closing(_Past(upstream)) as past:
        forgery = ImageForgery(plan, past)
        for step in steps:
            frame = forgery.forge(step.frame)
            yield step if frame is step.frame else replace(step, frame=frame)


class ImageForgery:
    """One attack in one pass over the frames of a recording, or of a running robot."""

    def __init__(self, plan: Plan, past: Past) -> None:
        self._plan, self._past = plan, past
        self._held: dict[str, Frame] = {}
        self._occluders: dict[str, GrayImage] = {}

    def forge(self, frame: Frame) -> Frame:
        """What is sent instead of `frame`: itself, where it is not attacked."""
        plan = self._plan
        if plan.spec["source"] not in (None, frame.camera):
            return frame
        if not plan.span.holds(frame.stamp_ns):
            if frame.stamp_ns < plan.span.start_ns:
                self._held[frame.camera] = frame
            return frame
        last_honest = self._held.setdefault(frame.camera, frame)
        return replace(frame, image=_false_image(plan, frame, last_honest, self._past, self._occluders))


def _false_image(
    plan: Plan, frame: Frame, last_honest: Frame, past: Past, occluders: dict[str, GrayImage]
) -> GrayImage:
    match plan.spec.kind:
        case "freeze":
            return _grainy(plan, frame, last_honest.image, plan.spec.number("noise"))
        case "replay" | "delay":
            wanted_ns = _wanted_ns(plan, frame.stamp_ns)
            if plan.spec.kind == "delay" and wanted_ns <= last_honest.stamp_ns:
                return last_honest.image
            return past.image(frame.camera, wanted_ns, last_honest)
        case "black":
            black = np.full_like(frame.image, int(plan.spec.number("level")))
            return _grainy(plan, frame, black, plan.spec.number("noise"))
        case "cover":
            if frame.camera not in occluders:
                occluders[frame.camera] = _occluder(plan, frame)
            top, left, height, width = _covered(plan, frame)
            image = frame.image.copy()
            image[top : top + height, left : left + width] = _grainy(
                plan, frame, occluders[frame.camera], plan.spec.number("noise")
            )
            return image
        case _:
            return _grainy(plan, frame, frame.image, plan.spec.number("sigma"))


def _wanted_ns(plan: Plan, stamp_ns: int) -> int:
    """Stamp of the frame whose image is shown: whole frames back, or the nearest frame to so many seconds."""
    stamps = plan.clock.stamps_ns
    lag = plan.spec.timing("delay")
    if lag.unit == "frame":
        here = int(np.searchsorted(stamps, stamp_ns))
        return int(stamps[max(0, here - int(lag.value))])
    return int(stamps[np.argmin(np.abs(stamps - plan.clock.before(stamp_ns, lag)))])


class _Past:
    """A second, lagging reading of the recording, so that a long delay costs no memory."""

    def __init__(self, upstream: Upstream) -> None:
        self._upstream = upstream
        self._steps: Iterator[Step] | None = None
        self._next: Frame | None = None
        self._shown: dict[str, Frame] = {}

    def image(self, camera: str, stamp_ns: int, fallback: Frame) -> GrayImage:
        """The newest image of `camera` stamped up to `stamp_ns`; stamps must not decrease between calls."""
        if self._steps is None:
            self._steps = self._upstream()
            self._advance()
        while self._next is not None and self._next.stamp_ns <= stamp_ns:
            self._shown[self._next.camera] = self._next
            self._advance()
        return self._shown.get(camera, fallback).image

    def close(self) -> None:
        """Stop the second reading."""
        close = getattr(self._steps, "close", None)
        if close is not None:
            close()

    def _advance(self) -> None:
        step = next(self._steps, None) if self._steps is not None else None
        self._next = None if step is None else step.frame


def _grainy(plan: Plan, frame: Frame, image: GrayImage, sigma: float) -> GrayImage:
    """`image` with white noise that depends on the seed, the camera and the frame's stamp alone."""
    if sigma == 0.0:
        return image
    rng = _random(plan, frame.camera, frame.stamp_ns)
    noise = np.float32(sigma) * rng.standard_normal(image.shape, dtype=np.float32)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def _random(plan: Plan, camera: str, *words: int) -> np.random.Generator:
    tag = zlib.crc32(f"{plan.spec.name}|{camera}".encode())
    return np.random.default_rng([int(plan.spec.number("seed")), tag, *words])


def _covered(plan: Plan, frame: Frame) -> tuple[int, int, int, int]:
    """Top, left, height and width of the occluder, px: a shrunken image, placed by the seed."""
    rows, columns = frame.image.shape
    side = float(np.sqrt(plan.spec.number("fraction")))
    height, width = max(1, round(rows * side)), max(1, round(columns * side))
    rng = _random(plan, frame.camera)
    top, left = rng.integers(0, rows - height, endpoint=True), rng.integers(0, columns - width, endpoint=True)
    return int(top), int(left), height, width


def _occluder(plan: Plan, frame: Frame) -> GrayImage:
    _, _, height, width = _covered(plan, frame)
    level = int(plan.spec.number("level"))
    if plan.spec["texture"] == "plain":
        return np.full((height, width), level, dtype=np.uint8)
    weave = _random(plan, frame.camera, 1).standard_normal((height, width), dtype=np.float32)
    weave = np.asarray(cv2.GaussianBlur(weave, (0, 0), 1.5))
    contrast = 40.0 / max(float(weave.std()), 1e-6)
    return np.asarray(np.clip(np.rint(level + 80.0 + contrast * weave), 0, 255), dtype=np.uint8)
