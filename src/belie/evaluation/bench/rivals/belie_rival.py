"""belie's own profiles as detectors of the benchmark."""

from __future__ import annotations

from belie.detector import Config, Detector
from belie.evaluation.bench.rivals.protocol import Cameras
from belie.evaluation.bench.rivals.remembered import LookingEyes, RememberingEyes, Sight
from belie.odometry import VisualOdometry
from belie.types import Alert, AlertType, CheckResult, Status, Step


class BelieRival:
    """`belie.detector.Detector`, with eyes that may remember what an earlier run over the same images saw.

    Parameters
    ----------
    cameras : mapping of str to MountedCamera
        The one camera.
    config : Config
        Settings; its profile says which one this is.
    sights : list of Sight, optional
        What an earlier run saw (`default` profile only); it is not looked at again.
    """

    judges = frozenset(AlertType)

    def __init__(self, cameras: Cameras, config: Config, *, sights: list[Sight] | None = None) -> None:
        self._remembering: RememberingEyes | None = None
        self._looking: LookingEyes | None = None
        if config.profile == "default":
            ((_, camera),) = cameras.items()
            eyes = VisualOdometry(camera.model, config.visual_odometry, config.tracking)
            if sights is None:
                self._looking = LookingEyes(eyes)
            else:
                self._remembering = RememberingEyes(eyes, sights)
            self.detector = Detector(cameras, config, eyes=self._looking or self._remembering)
        else:
            self.detector = Detector(cameras, config)
        self.checks: tuple[CheckResult, ...] = ()
        self.status = Status.UNDECIDED

    def update(self, step: Step) -> tuple[Alert, ...]:
        """Judge one frame."""
        if self._remembering is not None:
            self._remembering.spent_ms = 0.0
        verdict = self.detector.update(step.frame, step.claims)
        self.checks, self.status = verdict.checks, verdict.status
        return verdict.alerts

    @property
    def seeing_ms(self) -> float:
        """What looking at the last frame took, now or earlier; 0 in the paper profile, which sees by claims."""
        if self._looking is not None:
            return self._looking.sights[-1].spent_ms if self._looking.sights else 0.0
        return self.saved_ms

    @property
    def saved_ms(self) -> float:
        """What looking at the last frame would have taken on top."""
        return 0.0 if self._remembering is None else self._remembering.spent_ms

    @property
    def sights(self) -> list[Sight] | None:
        """What was seen, for the next run; None where nothing can be remembered."""
        return None if self._looking is None else self._looking.sights
