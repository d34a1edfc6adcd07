"""What a lie does to a vehicle that drives on it, and what belie's alert saves: the loop closed in simulation.

The vehicle is steered by a driver that believes the claims, attacked or not; the claims are measured on where it then
truly is. With belie in the loop, an alert makes it distrust the accused source, go on by what is left, and brake.

An attack hands a frame on when the next one is known, so that every attack adds one frame of delay to the loop, as a
man in the middle would.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from typing import Any

from belie.attacks import attack
from belie.detector import Config, Detector
from belie.simulation.driven import DrivenRecording
from belie.simulation.driver import ClaimedState, Driver, DriverSettings
from belie.simulation.scenario import Scenario
from belie.simulation.simulate import Replay, SimulatedRecording
from belie.simulation.stage import START_NS, View
from belie.simulation.vehicle import VehicleSettings
from belie.simulation.world import World
from belie.types import AlertType, Claim, MountedCamera, Step

_STANDS_M_S = 0.1
_STOPPING = (AlertType.ODOMETRY_SPOOFING, AlertType.POSITION_SPOOFING)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How one drive ended.

    Parameters
    ----------
    guarded : bool
        Whether belie's alert could stop it.
    collision : str or None
        What it ran into, or that it left the road.
    collision_s, alert_s, stopped_s : float or None
        When, seconds from the start.
    alert : str or None
        Type and source of the first alert.
    most_off_lane_m : float
        Largest distance of the vehicle's middle from the lane's.
    driven_s : float
        How long the drive lasted.

    Examples
    --------
    >>> Outcome(guarded=True, driven_s=15.0, most_off_lane_m=0.2).safe
    True
    """

    guarded: bool
    collision: str | None = None
    collision_s: float | None = None
    alert: str | None = None
    alert_s: float | None = None
    stopped_s: float | None = None
    most_off_lane_m: float
    driven_s: float

    @property
    def safe(self) -> bool:
        """Whether nothing was hit."""
        return self.collision is None

    def to_json(self) -> dict[str, Any]:
        """As written beside a recording."""
        return {**asdict(self), "safe": self.safe}

    def in_words(self) -> str:
        """One line for a person.

        >>> Outcome(guarded=False, collision="left the road", collision_s=7.5, most_off_lane_m=1.9,
        ...         driven_s=7.5).in_words()
        'without belie: left the road at 7.50 s'
        """
        who = "with belie" if self.guarded else "without belie"
        told = "" if self.alert is None else f"{self.alert} alert at {self.alert_s:.2f} s; "
        off = f"{self.most_off_lane_m:.2f} m off the lane's middle at most"
        if self.collision is not None:
            end = f"{self.collision} at {self.collision_s:.2f} s"
        elif self.stopped_s is not None:
            end = f"stopped safely at {self.stopped_s:.2f} s, {off}"
        else:
            end = f"no collision in {self.driven_s:.1f} s, {off}"
        return f"{who}: {told}{end}"


class ClosedLoop:
    """One drive on claims, attacked or not, with or without belie; `steps` drives, `outcome` tells how it ended.

    Parameters
    ----------
    scenario : Scenario
        Where to drive; its manoeuvre's speed at the start is the driver's aim.
    specs : sequence of str
        Attacks; see `belie.attacks`.
    guarded : bool
        Whether belie's alert stops the vehicle.
    config : Config, optional
        Of the detector.
    on_view : callable, optional
        Is given every rendered view.
    simulated : SimulatedRecording, optional
        The scenario already set up; by default it is built.
    """

    def __init__(
        self,
        scenario: Scenario,
        specs: Sequence[str],
        *,
        guarded: bool,
        config: Config | None = None,
        on_view: Callable[[View], None] | None = None,
        simulated: SimulatedRecording | None = None,
        vehicle: VehicleSettings | None = None,
        driver: DriverSettings | None = None,
    ) -> None:
        simulated = simulated or SimulatedRecording(scenario)
        settings = driver or DriverSettings()
        self._driven = DrivenRecording(simulated, settings=vehicle or VehicleSettings(), on_view=on_view)
        self.attacked = attack(self._driven, list(specs)) if specs else self._driven
        self._guard = Detector(self._driven.cameras, config) if guarded else None
        world, start = self._driven.world, self._driven.vehicle
        self._state = ClaimedState(
            start.T_world_body(0.0), speed_m_s=start.speed_m_s, correction_s=settings.correction_s
        )
        self._driver = Driver(
            settings,
            world.lane.centre_m,
            target_m_s=world.lane.speed_m_s,
            wheelbase_m=start.settings.wheelbase_m,
            T_body_cam=world.T_body_cam,
        )
        self._alert: tuple[str, float] | None = None
        self._stopped_s: float | None = None

    @property
    def cameras(self) -> Mapping[str, MountedCamera]:
        """The one camera."""
        return self._driven.cameras

    def steps(self) -> Iterator[Step]:
        """Drive: every step as it was claimed; ends at the end, at a collision, or at a standstill after an alert."""
        interval_s = 1.0 / self._driven.scenario.frame_rate_hz
        with closing(_generated(self.attacked.steps())) as steps:
            for step in steps:
                self._driven.command = self._decide(step, interval_s)
                yield step
                if self._alert is not None and self._driven.vehicle.speed_m_s < _STANDS_M_S:
                    self._stopped_s = self._driven.vehicle.now_s
                    return

    def replayed(self) -> Replay:
        """The honest claims of the drive; see `SimulatedRecording.replayed`."""
        return self._driven.replayed()

    def run(self) -> Outcome:
        """Drive to the end, and tell how it ended."""
        for _ in self.steps():
            pass
        return self.outcome()

    def outcome(self) -> Outcome:
        """How the drive ended; to be asked after `steps`."""
        collision_s, collision = self._driven.collision or (None, None)
        alert, alert_s = self._alert or (None, None)
        return Outcome(
            guarded=self._guard is not None,
            collision=collision,
            collision_s=collision_s,
            alert=alert,
            alert_s=alert_s,
            stopped_s=self._stopped_s,
            most_off_lane_m=self._driven.most_off_lane_m,
            driven_s=self._driven.vehicle.now_s,
        )

    def _decide(self, step: Step, interval_s: float) -> tuple[float, float]:
        """Steering and acceleration until the next frame."""
        self._believe(step.claims)
        if self._guard is not None:
            self._listen(step)
        steer_rad, acceleration = self._driver.command(
            self._state.T_world_body, speed_m_s=self._state.speed_m_s
        )
        if self._alert is not None:
            braking = self._driven.vehicle.settings.most_braking_m_s2
            self._state.slow_down(braking, interval_s)
            acceleration = -braking
        return steer_rad, acceleration

    def _believe(self, claims: Sequence[Claim]) -> None:
        self._state.take(claims)
        self._driver.see(claims)

    def _listen(self, step: Step) -> None:
        assert self._guard is not None
        for alert in self._guard.update(step.frame, step.claims).alerts:
            if alert.type in _STOPPING:
                self._state.distrust(alert.source, alert.onset_ns)
                if self._alert is None:
                    named = f"{alert.type.value} of {alert.source}"
                    self._alert = (named, (step.frame.stamp_ns - START_NS) * 1e-9)


def _generated(steps: Iterator[Step]) -> Generator[Step, None, None]:
    """As a generator, which can be closed."""
    yield from steps


def compare(
    scenario: Scenario, specs: Sequence[str], *, world: World | None = None, config: Config | None = None
) -> tuple[Outcome, Outcome]:
    """The same attacked drive without belie and with it."""
    simulated = SimulatedRecording(scenario, world=world)
    without = ClosedLoop(scenario, specs, guarded=False, simulated=simulated).run()
    with_belie = ClosedLoop(scenario, specs, guarded=True, config=config, simulated=simulated).run()
    return without, with_belie
