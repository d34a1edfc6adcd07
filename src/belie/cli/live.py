"""``belie live``: beside a running robot."""

from __future__ import annotations

import os
import signal
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from belie.cli.errors import ALERT_RAISED
from belie.cli.options import CameraInfo, Detections, FalseAlarms, Image, Imu, Odometry, Position, Profile

if TYPE_CHECKING:
    from belie.bridges.live import LiveSession
    from belie.bridges.settings import LiveSettings


class Middleware(StrEnum):
    """The middlewares that belie speaks."""

    DDS = "dds"
    ZENOH = "zenoh"
    ROS1 = "ros1"


MiddlewareName = Annotated[
    Middleware,
    typer.Argument(help="ROS 2 over DDS, ROS 2 over Zenoh (rmw_zenoh), or ROS 1.", show_default=False),
]
LiveConfig = Annotated[
    Path | None,
    typer.Option("--config", metavar="live.toml", help="Settings; --print-config prints them all."),
]
Remap = Annotated[
    list[str] | None,
    typer.Option(
        "--remap", metavar="NAME:=OTHER", help="Use OTHER on the wire for NAME; may be given often."
    ),
]
Domain = Annotated[int | None, typer.Option("--domain", metavar="N", help="ROS domain.", min=0, max=232)]
Interface = Annotated[
    str | None, typer.Option("--interface", metavar="NAME", help="Network interface for DDS, e.g. lo.")
]
Endpoint = Annotated[
    str | None, typer.Option("--endpoint", metavar="tcp/HOST:PORT", help="Zenoh router (tcp/ or tls/).")
]
Master = Annotated[str | None, typer.Option("--master", metavar="URI", help="ROS 1 master.")]


def live(
    middleware: MiddlewareName,
    config: LiveConfig = None,
    list_topics: Annotated[
        bool, typer.Option("--list", help="List what is published, and what belie would use; then exit.")
    ] = False,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print every setting, explained, as TOML; then exit.")
    ] = False,
    image: Image = None,
    camera_info: CameraInfo = None,
    odometry: Odometry = None,
    position: Position = None,
    imu: Imu = None,
    detections: Detections = None,
    remap: Remap = None,
    profile: Profile = None,
    false_alarms_per_hour: FalseAlarms = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE|-", help="Write one JSON object a frame.")
    ] = None,
    metrics: Annotated[
        str | None,
        typer.Option("--metrics", metavar="HOST:PORT", help="Serve Prometheus metrics, e.g. 127.0.0.1:9464."),
    ] = None,
    evidence: Annotated[
        Path | None,
        typer.Option(
            "--evidence", metavar="FOLDER", help="Keep a bag of what was received around each alert."
        ),
    ] = None,
    tui: Annotated[
        bool, typer.Option("--tui", help="Draw streams, verdicts and alerts on the terminal.")
    ] = False,
    domain: Domain = None,
    interface: Interface = None,
    endpoint: Endpoint = None,
    master: Master = None,
) -> None:
    """Check a running robot's claims against its camera, and answer in the robot's own conventions.

    Answers: /diagnostics, latched alerts on /belie/alerts, and what the settings ask for (JSON lines, Prometheus,
    evidence bags, MQTT, webhook). Topics are found by message type, as in 'belie check'. SIGHUP reads the settings
    again; SIGINT and SIGTERM stop.

    \b
    Examples:
      belie live dds --list
      belie live dds --json verdicts.jsonl --metrics 127.0.0.1:9464 --evidence /var/lib/belie
      belie live zenoh --endpoint tcp/127.0.0.1:7447 --odometry /odom
      belie live ros1 --config live.toml

    \b
    Exit codes: 0 no alert, 1 alert raised, 2 usage or data error.
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.bridges.transports.opening import TransportName, open_transport

    flags: dict[str, Any] = {
        "topics": {
            "image": image,
            "camera_info": camera_info,
            "odometry": odometry,
            "position": position,
            "imu": imu,
            "detections": detections,
            "remap": pairs_of(remap),
        },
        "metrics": metrics,
        "evidence": {"folder": None if evidence is None else str(evidence)},
        **network_flags(domain, interface, endpoint, master),
    }

    def read() -> LiveSettings:
        return settings_of(config, flags, profile, false_alarms_per_hour)

    settings = read()
    if print_config:
        from belie.evaluation.config_toml import to_toml

        print(to_toml(settings, header="Settings of: belie live --config live.toml"), end="")
        return
    if not list_topics:
        say(f"start: {middleware.value}")
        from belie.bridges.monitor import warm_up

        warm_up(settings.detector)
    transport = open_transport(TransportName(middleware.value), settings)
    try:
        if list_topics:
            _print_offers(transport, settings)
            return
        raised = _sessions(transport, read, settings, json, tui)
    finally:
        transport.close()
    if raised:
        raise typer.Exit(ALERT_RAISED)


def _sessions(transport: Any, read: Any, settings: LiveSettings, json: Path | None, tui: bool) -> bool:
    """Sessions one after another, a new one at every SIGHUP; True where an alert was raised."""
    from belie.bridges.live import LiveSession
    from belie.types import BelieError, ConfigError

    raised = False
    if json is not None and json != Path("-"):
        json.write_text("", encoding="utf-8")  # sessions append
    session = LiveSession(transport, settings, json=json, dashboard=tui, on_event=say)

    def ask(number: int, _: Any) -> None:
        session.request("reload" if number == signal.SIGHUP else "stop")

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, ask)
    notify("READY=1")
    proven: LiveSettings | None = None  # settings that a session has run with
    while True:
        try:
            outcome = session.run()
        except BelieError as error:
            if proven is None:
                raise
            say(f"the new settings do not work, the old ones stay: {error}")
            transport.reset()
            settings, proven = proven, None
        else:
            proven = settings
            _tell_end(session, outcome)
            raised = raised or bool(session.board.raised)
            if outcome == "stop":
                return raised
            try:
                settings = read()
            except ConfigError as error:
                say(f"reload refused, the old settings stay: {error}")
        session = LiveSession(transport, settings, json=json, dashboard=tui, on_event=say)


def _tell_end(session: LiveSession, outcome: str) -> None:
    board, inputs = session.board, session.picture().inputs
    say(
        f"{outcome}: {sum(board.statuses.values())} frames answered, {sum(board.raised.values())} alerts, "
        f"{sum(one.dropped for one in inputs)} messages dropped, {sum(one.lost for one in inputs)} lost"
    )


def say(text: str) -> None:
    """One line on stderr, at once."""
    print(f"belie live: {' '.join(text.split())}", file=sys.stderr, flush=True)


def notify(state: str) -> None:
    """Tell systemd (Type=notify), where it asked to be told."""
    import socket

    address = os.environ.get("NOTIFY_SOCKET")
    if address:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
            out.sendto(state.encode(), "\0" + address[1:] if address.startswith("@") else address)


def pairs_of(remap: list[str] | None) -> dict[str, str] | None:
    """``NAME:=OTHER`` as a mapping.

    Raises
    ------
    ConfigError
        If one of them is not of this form.

    Examples
    --------
    >>> pairs_of(["/odom:=/robot/odom"])
    {'/odom': '/robot/odom'}
    """
    from belie.types import ConfigError

    if not remap:
        return None
    pairs = {}
    for text in remap:
        name, sign, other = text.partition(":=")
        if not (sign and name.startswith("/") and other.startswith("/")):
            raise ConfigError(f"--remap {text}: expected /NAME:=/OTHER")
        pairs[name] = other
    return pairs


def network_flags(
    domain: int | None, interface: str | None, endpoint: str | None, master: str | None
) -> dict[str, dict[str, Any]]:
    """The flags of the network as settings."""
    return {
        "dds": {"domain": domain, "interface": interface},
        "zenoh": {"domain": domain, "endpoint": endpoint},
        "ros1": {"master": master},
    }


def settings_of(
    config: Path | None,
    flags: dict[str, Any],
    profile: str | None = None,
    false_alarms_per_hour: float | None = None,
) -> LiveSettings:
    """A file's settings (or the defaults) with what the flags say instead.

    Raises
    ------
    ConfigError
        On an unknown setting or a value out of range.

    Examples
    --------
    >>> settings_of(None, {"topics": {"image": "/cam", "imu": None}}).topics.image
    '/cam'
    """
    from belie.bridges.settings import load_live_settings, parse_live_settings

    values = {} if config is None else load_live_settings(config)
    detector = {"profile": profile, "sequential": {"false_alarms_per_hour": false_alarms_per_hour}}
    _lay_over(values, flags | {"detector": detector})
    return parse_live_settings(values, "settings" if config is None else str(config))


def _lay_over(values: dict[str, Any], given: dict[str, Any]) -> None:
    for key, value in given.items():
        if isinstance(value, dict) and isinstance(values.get(key, {}), dict):
            if any(entry is not None for entry in value.values()):
                _lay_over(values.setdefault(key, {}), value)
        elif value is not None:
            values[key] = value


def _print_offers(transport: Any, settings: LiveSettings) -> None:
    from rich.console import Console
    from rich.table import Table

    from belie.bridges.discovery import choose_now, list_offers, topics_of
    from belie.types import TopicError

    offers = list_offers(transport, settings.intake.settle_s)
    used: set[str] = set()
    problem = ""
    try:
        used = {topic.name for topic in choose_now(offers, settings.topics).all}
    except TopicError as error:
        problem = str(error)
    table = Table(box=None)
    for title in ("", "topic", "part", "type", "publishers", "reliable", "latched"):
        table.add_column(title)
    parts = {(topic.name, topic.message_type): topic.role for topic in topics_of(offers)}
    for offer in offers:
        part = parts.get((offer.topic, offer.message_type), "other")
        table.add_row(
            "*" if offer.topic in used else "",
            offer.topic,
            part,
            offer.message_type,
            str(offer.publishers),
            "yes" if offer.reliable else "no",
            "yes" if offer.latched else "no",
        )
    Console(width=max(140, Console().width), highlight=False, markup=False).print(table)
    print(f"not ready: {problem}" if problem else "belie live would use the topics marked *")
