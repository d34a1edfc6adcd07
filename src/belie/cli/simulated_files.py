"""What ``belie simulate`` writes: the recording, and the truth, labels, pictures and outcome beside it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from belie.cli.output import Encoding, require_free, write_labels, write_recording

if TYPE_CHECKING:
    from belie.attacks import AttackLabel, AttackSpec
    from belie.evaluation.closed_loop import Outcome
    from belie.geometry import SE3
    from belie.simulation.scenario import Scenario
    from belie.simulation.simulate import Replay
    from belie.simulation.stage import View
    from belie.types import MountedCamera, Step


class Replayed(Protocol):
    """A drive that was simulated, and whose honest claims are still known."""

    def replayed(self) -> Replay:
        """The claims before black frames."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedFiles:
    """Where everything goes, and how images are stored."""

    recording: Path
    preview: Path | None
    depth: Path | None
    encoding: Encoding
    jpeg_quality: int

    @property
    def labels(self) -> Path:
        """What lies, and when."""
        from belie.attacks import labels_path

        return labels_path(self.recording)

    @property
    def trajectory(self) -> Path:
        """True poses."""
        from belie.simulation.truth import trajectory_path

        return trajectory_path(self.recording)

    @property
    def objects(self) -> Path:
        """True objects."""
        from belie.simulation.truth import objects_path

        return objects_path(self.recording)

    @property
    def outcome(self) -> Path:
        """How a closed loop ended."""
        return self.recording.with_name(f"{self.recording.name}.closed_loop.json")

    def make_room(self, *, force: bool) -> None:
        """Refuse, before anything is rendered, what cannot or must not be written; remove what is stale.

        Raises
        ------
        RecordingError
            On a name that cannot be written, or one that is taken without `force`.
        """
        from belie.simulation.preview import require_suffix
        from belie.types import RecordingError

        beside = [self.labels, self.trajectory, self.objects, self.outcome]
        if self.preview is not None:
            require_suffix(self.preview)
            if not self.preview.resolve().parent.is_dir():
                raise RecordingError(
                    f"--preview {self.preview}: the folder {self.preview.parent} does not exist"
                )
            beside.append(self.preview)
        require_free(self.recording, beside, force=force)
        for path in beside:
            path.unlink(missing_ok=True)  # nothing stale may lie beside a new recording

    def write_recording(
        self, steps: Iterable[Step], cameras: Mapping[str, MountedCamera], scenario: Scenario
    ) -> None:
        """Render and write, under a progress bar."""
        from belie.recordings import GeodeticPoint

        gnss = scenario.sensors.gnss
        write_recording(
            self.recording,
            steps,
            doing="rendering",
            frames=scenario.frame_count,
            cameras=cameras,
            body_axes="flu",
            encoding=self.encoding,
            jpeg_quality=self.jpeg_quality,
            geodetic_origin=GeodeticPoint(
                latitude_deg=gnss.latitude_deg, longitude_deg=gnss.longitude_deg, altitude_m=gnss.altitude_m
            ),
        )

    def write_labels(self, drive: Replayed, specs: Sequence[AttackSpec | str]) -> tuple[AttackLabel, ...]:
        """The labels, from the claims that were just simulated: nothing is rendered again."""
        from belie.attacks import attack

        attacked = attack(drive.replayed(), list(specs))
        write_labels(self.labels, attacked)
        return tuple(attacked.labels)

    def write_outcome(self, specs: Sequence[str], outcomes: Sequence[Outcome]) -> None:
        """How a closed loop ended, as JSON."""
        from belie.types import RecordingError

        document = {
            "format": "belie-closed-loop",
            "attacks": list(specs),
            "outcomes": [outcome.to_json() for outcome in outcomes],
        }
        try:
            self.outcome.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise RecordingError(f"cannot write {self.outcome}: {error.strerror}") from None


class Watcher:
    """Takes in every rendered view: truth always, pictures and depth where they are wanted.

    It is closed with `stack`.
    """

    def __init__(self, scenario: Scenario, files: SimulatedFiles, stack: ExitStack) -> None:
        from belie.simulation.preview import Preview

        self._files = files
        self._lines: list[str] = []
        self._poses: list[tuple[int, SE3]] = []
        self._preview: Any = None
        if files.preview is not None:
            count, rate_hz = scenario.frame_count, scenario.frame_rate_hz
            self._preview = stack.enter_context(Preview(files.preview, frame_count=count, rate_hz=rate_hz))
        if files.depth is not None:
            files.depth.mkdir(parents=True, exist_ok=True)

    def __call__(self, view: View) -> None:
        """Take in one view."""
        from belie.simulation.truth import objects_line, write_depth

        self._lines.append(objects_line(view))
        self._poses.append((view.frame.stamp_ns, view.T_world_body))
        if self._preview is not None:
            self._preview.add(view)
        if self._files.depth is not None and view.rendered.depth_m is not None:
            write_depth(self._files.depth, view.index, view.rendered.depth_m)

    def write_truth(self) -> None:
        """Write trajectory and objects beside the recording."""
        from belie.simulation.truth import write_objects, write_trajectory

        write_trajectory(self._files.trajectory, self._poses)
        write_objects(self._files.objects, self._lines)
