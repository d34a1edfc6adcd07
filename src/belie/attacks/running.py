"""Attacks on a running robot: claims and frames forged one at a time, as they come."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from functools import partial

from belie.attacks.camera import ImageForgery
from belie.attacks.detections import DetectionAttack
from belie.attacks.imu import imu_forger
from belie.attacks.kind import Stream
from belie.attacks.odometry import odometry_forger
from belie.attacks.plan import Plan
from belie.attacks.position import no_headings, note_heading, position_forger
from belie.attacks.source import BodyAxes
from belie.attacks.spec import AttackSpec
from belie.attacks.stream import ClaimForgery
from belie.attacks.timing import FrameClock
from belie.types import Claim, Frame, GrayImage, MountedCamera

_MOST_PAST_BYTES = 256_000_000


class RunningAttack:
    """Attacks that act on what passes by: the first specification acts first, the next on its outcome.

    Parameters
    ----------
    specs : iterable of AttackSpec
        The attacks; starts count from the clock's first frame.
    clock : FrameClock
        When frames come: see `FrameClock.steady`.
    body_axes : "flu" or "rdf"
        How the body frame lies in the vehicle.
    camera : MountedCamera, optional
        For attacks that need it.

    Examples
    --------
    >>> import numpy as np
    >>> from belie.geometry import SE3
    >>> from belie.types import PoseClaim
    >>> spec = AttackSpec.of("odometry-offset", axis="y", rate=0.2, start=1, stop=3)
    >>> attack = RunningAttack([spec], FrameClock.steady(0, 100, 1000), "flu")
    >>> honest = [PoseClaim(source="/odom", frame_id="odom", stamp_ns=t, received_ns=t, T_odom_body=SE3.identity())
    ...           for t in (0, 100, 200, 300)]
    >>> [attack.forge(claim).T_odom_body.t[1].item() for claim in honest]
    [0.0, 0.2, 0.4, 0.0]
    """

    def __init__(
        self,
        specs: Iterable[AttackSpec],
        clock: FrameClock,
        body_axes: BodyAxes,
        camera: MountedCamera | None = None,
    ) -> None:
        self._headings = no_headings()
        self._forges: list[Callable[[Claim], Claim]] = []
        self._images: list[ImageForgery] = []
        self._past = _RecentPast()
        for spec in specs:
            plan = Plan.of(spec, clock, body_axes, camera)
            if spec.stream == "camera":
                self._images.append(ImageForgery(plan, self._past))
            else:
                self._forges.append(self._forge_of(plan))

    def _forge_of(self, plan: Plan) -> Callable[[Claim], Claim]:
        match plan.spec.stream:
            case "detections":
                return DetectionAttack(plan).forge
            case "imu":
                return ClaimForgery(plan, partial(imu_forger, plan)).forge
            case "position":
                headings = self._headings
                return ClaimForgery(plan, lambda source: position_forger(plan, source, headings)).forge
            case _:
                return ClaimForgery(plan, partial(odometry_forger, plan)).forge

    def forge(self, claim: Claim) -> Claim:
        """What is sent instead of a claim: itself, where it is not attacked; a pose comes before its twist."""
        note_heading(self._headings, claim)
        for forge in self._forges:
            claim = forge(claim)
        return claim

    def forge_frame(self, frame: Frame) -> Frame:
        """What is sent instead of a frame: itself, where it is not attacked."""
        self._past.add(frame)
        for image in self._images:
            frame = image.forge(frame)
        return frame


def attacked_streams(specs: Iterable[AttackSpec]) -> tuple[Stream, ...]:
    """Which streams are attacked, in order, each once.

    >>> attacked_streams([AttackSpec.of("imu-freeze"), AttackSpec.of("imu-flip")])
    ('imu',)
    """
    return tuple(dict.fromkeys(spec.stream for spec in specs))


class _RecentPast:
    """The last frames, as far back as memory allows: a longer delay shows the oldest that is left."""

    def __init__(self) -> None:
        self._frames: deque[Frame] = deque()
        self._bytes = 0

    def add(self, frame: Frame) -> None:
        self._frames.append(frame)
        self._bytes += frame.image.nbytes
        while self._bytes > _MOST_PAST_BYTES:
            self._bytes -= self._frames.popleft().image.nbytes

    def image(self, camera: str, stamp_ns: int, fallback: Frame) -> GrayImage:
        found = fallback
        for frame in self._frames:
            if frame.stamp_ns > stamp_ns:
                break
            found = frame
        return found.image
