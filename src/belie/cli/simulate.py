"""``belie simulate``: a rendered recording with sensors and labels, or a drive on its own claims."""

from __future__ import annotations

import re
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from belie.cli.output import Encoding, tell_choices
from belie.cli.simulated_files import SimulatedFiles, Watcher

if TYPE_CHECKING:
    from belie.attacks import Choice
    from belie.simulation.scenario import Scenario


class SimulateCommand(TyperCommand):
    """A command whose help ends with the scenarios of the package."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the usual help, then the scenarios."""
        from belie.simulation.scenario import scenario_text, shipped_scenarios

        super().format_help(ctx, formatter)
        formatter.write("\nScenarios\n")
        for name in shipped_scenarios():
            formatter.write(f"  {name:<20} {scenario_text(name).splitlines()[0].removeprefix('# ')}\n")


def simulate(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO", help="A scenario of the package, or a TOML file.", show_default=False
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="OUT.mcap", help="Where to write; labels go beside it."),
    ] = None,
    weather: Annotated[
        str | None,
        typer.Option(
            "--weather",
            metavar="W",
            help="sunny, light-rain, night, rainy-night, light-fog, heavy-fog or low-sun.",
        ),
    ] = None,
    manoeuvre: Annotated[
        str | None,
        typer.Option(
            "--manoeuvre", metavar="M", help="straight, curve, lane-change, stop-and-go, narrow, highway."
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", metavar="N", help="Of the world and of every error.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option("--duration", metavar="S", help="Length of the recording [s].")
    ] = None,
    size: Annotated[
        str | None, typer.Option("--size", metavar="WxH", help="Image size [px], as 1280x720.")
    ] = None,
    frame_rate: Annotated[
        float | None, typer.Option("--frame-rate", metavar="HZ", help="Images [Hz].")
    ] = None,
    attack: Annotated[
        list[str] | None,
        typer.Option(
            "--attack",
            metavar="SPEC",
            help="As 'belie attack' takes it; may be given several times. To choose an object that stays, where "
            "SPEC names none, the drive is rendered once more before (not in a closed loop).",
        ),
    ] = None,
    preview: Annotated[
        Path | None,
        typer.Option("--preview", metavar="FILE.mp4|png", help="Show what was rendered, with boxes drawn."),
    ] = None,
    depth: Annotated[
        Path | None,
        typer.Option("--depth", metavar="FOLDER", help="Write true depth as 16-bit PNGs, 256 a metre."),
    ] = None,
    closed_loop: Annotated[
        bool,
        typer.Option(
            "--closed-loop",
            help="Let a driver steer by the claims, first without belie and then with its alerts.",
        ),
    ] = False,
    encoding: Annotated[
        Encoding, typer.Option("--encoding", help="How to store images; png and mono8 lose nothing.")
    ] = Encoding.JPEG,
    jpeg_quality: Annotated[
        int, typer.Option("--jpeg-quality", metavar="Q", help="1 to 100, for jpeg.", min=1, max=100)
    ] = 95,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite OUT.mcap and what lies beside it.")
    ] = False,
    show: Annotated[
        bool, typer.Option("--print", help="Print the scenario as TOML, every setting explained, and stop.")
    ] = False,
) -> None:
    """Render a drive with all its sensors and write it as a ROS 2 bag, with the truth beside it.

    Beside OUT.mcap lie the true trajectory (.groundtruth.tum), the true objects of every frame (.objects.jsonl) and,
    with --attack, the labels (.labels.json). The same scenario and seed give the same bytes.

    \b
    Examples:
      belie simulate street-straight --weather heavy-fog --seed 7 -o fog.mcap
      belie simulate street-curve --attack paper-odometry -o attacked.mcap --preview attacked.mp4
      belie simulate street-straight --print > mine.toml    edit it, then: belie simulate mine.toml -o mine.mcap
      belie simulate closed-loop --attack odometry-offset:axis=left,rate=0.2,start=60 --closed-loop -o drive.mcap
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.simulation.scenario import load_scenario
    from belie.types import ConfigError

    width, height = _size(size)
    chosen = load_scenario(
        scenario,
        weather=weather,
        manoeuvre=manoeuvre,
        seed=seed,
        duration_s=duration,
        width=width,
        height=height,
        frame_rate_hz=frame_rate,
    )
    if show:
        from belie.evaluation.config_toml import to_toml

        print(
            to_toml(chosen, header=f"belie simulate {scenario}: every setting, with unit and meaning"), end=""
        )
        return
    if output is None:
        raise ConfigError(
            "name the recording to write with -o OUT.mcap, or look at the scenario with --print"
        )
    files = SimulatedFiles(
        recording=output, preview=preview, depth=depth, encoding=encoding, jpeg_quality=jpeg_quality
    )
    files.make_room(force=force)
    (_drive if closed_loop else _record)(chosen, attack or [], files)


def _size(text: str | None) -> tuple[int | None, int | None]:
    """Width and height of ``1280x720``; nothing of None.

    >>> _size("640x480"), _size(None)
    ((640, 480), (None, None))
    """
    from belie.types import ConfigError

    if text is None:
        return None, None
    match = re.fullmatch(r"(\d+)[xX](\d+)", text)
    if match is None:
        raise ConfigError(f"--size {text}: write it as WIDTHxHEIGHT, such as 1280x720")
    return int(match[1]), int(match[2])


def _record(scenario: Scenario, specs: list[str], files: SimulatedFiles) -> None:
    """The open loop: the robot moves as the scenario says, whatever it claims."""
    from belie.attacks import attack
    from belie.simulation.simulate import SimulatedRecording

    choices = _choices(scenario, specs)
    chosen = [choice.spec for choice in choices]
    with ExitStack() as stack:
        watcher = Watcher(scenario, files, stack)
        recording = SimulatedRecording(scenario, on_view=watcher)
        steps = attack(recording, chosen).steps() if chosen else recording.steps()
        files.write_recording(steps, recording.cameras, scenario)
    watcher.write_truth()
    if chosen:
        tell_choices(choices, files.write_labels(recording, chosen))
    print(f"wrote {files.recording}; beside it {files.trajectory.name} and {files.objects.name}")
    labels = f" --labels {files.labels}" if specs else ""
    print(f"now: belie check {files.recording}{labels}")


def _choices(scenario: Scenario, specs: list[str]) -> list[Choice]:
    """The attacks, each with an object as `belie attack` chooses it; to know which one stays, the drive is rendered."""
    from belie.attacks import Choice, attack, choose_objects, parse_attack
    from belie.attacks.staying import needs_object
    from belie.checks.objects import ObjectSettings
    from belie.cli.progress import progress
    from belie.simulation.simulate import SimulatedRecording

    parsed, recording = [parse_attack(spec) for spec in specs], SimulatedRecording(scenario)
    if parsed:
        attack(recording, parsed)  # what makes no sense is refused before anything is rendered
    if not any(map(needs_object, parsed)):
        return [Choice(spec=spec) for spec in parsed]
    with progress("choosing an object", scenario.frame_count) as advance:
        for _ in recording.steps():
            advance()
    return choose_objects(recording.replayed(), parsed, least_px=ObjectSettings().least_side_px)


def _drive(scenario: Scenario, specs: list[str], files: SimulatedFiles) -> None:
    """The closed loop: recorded without belie, then driven again with it."""
    from belie.cli.progress import progress
    from belie.evaluation.closed_loop import ClosedLoop
    from belie.simulation.simulate import SimulatedRecording

    simulated = SimulatedRecording(scenario)
    with ExitStack() as stack:
        watcher = Watcher(scenario, files, stack)
        without = ClosedLoop(scenario, specs, guarded=False, on_view=watcher, simulated=simulated)
        files.write_recording(without.steps(), without.cameras, scenario)
    watcher.write_truth()
    if specs:
        files.write_labels(without, specs)
    with_belie = ClosedLoop(scenario, specs, guarded=True, simulated=simulated)
    with progress("driving with belie", scenario.frame_count) as advance:
        for _ in with_belie.steps():
            advance()
    outcomes = [without.outcome(), with_belie.outcome()]
    files.write_outcome(specs, outcomes)
    for outcome in outcomes:
        print(outcome.in_words())
    print(f"wrote {files.recording} (the drive without belie), {files.outcome.name} and the truth beside it")
