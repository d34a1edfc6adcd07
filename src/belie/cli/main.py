"""The command line. Heavy imports happen inside the commands: ``belie --help`` answers at once."""

from __future__ import annotations

from typing import Annotated

import typer

from belie.cli import attack, bench, calibrate, check, config, demo, info, live, play, simulate
from belie.cli.errors import OneLineGroup

app = typer.Typer(
    cls=OneLineGroup,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"belie {version('belie')}")
        raise typer.Exit


@app.callback()
def belie(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version, and exit."
        ),
    ] = False,
) -> None:
    """Check what a robot claims of itself against what its camera sees.

    Odometry, IMU, GNSS and localisation say how a robot moved. The images of its camera say it too, and are
    hard to forge consistently. belie compares them frame by frame, names the stream that lies, and says what
    it could not decide.

    \b
    First steps:
      belie info  drive.mcap                      what is in it, and what would be checked
      belie check drive.mcap --report drive.html  check it; the report explains every figure
      belie attack drive.mcap paper-odometry -o attacked.mcap
      belie check attacked.mcap --labels attacked.mcap.labels.json

    \b
    Exit codes: 0 no alert, 1 alert raised, 2 usage or data error.
    """  # noqa: D301 (\b keeps the lines of the examples)


app.command("demo", short_help="A bundled drive, attacked and checked before your eyes.")(demo.demo)
app.command("info", short_help="What is in a recording, and what would be checked.")(info.info)
app.command("check", short_help="Check a recording against its own camera.")(check.check)
app.command("attack", cls=attack.AttackCommand, short_help="Write an attacked copy, with labels.")(
    attack.attack
)
app.command("live", short_help="Check a running robot (DDS, Zenoh, ROS 1).")(live.live)
app.command("play", short_help="Publish a recording as a robot would.")(play.play)
app.command("config", short_help="Every setting, explained, as TOML.")(config.config)
app.command("calibrate", short_help="Learn noise settings from attack-free driving.")(calibrate.calibrate)
app.command(
    "simulate", cls=simulate.SimulateCommand, short_help="Render a recording, with sensors and truth."
)(simulate.simulate)
app.command("bench", short_help="Detectors against attacks, measured: the paper's table, and yours.")(
    bench.bench
)
