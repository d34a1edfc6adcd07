"""Every setting of ``belie live``: topics, intake, answers, sinks; ``[detector]`` holds the detector's own."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from belie.detector import Config
from belie.recordings import JoinSettings
from belie.types import ConfigError, Settings


class TopicSettings(Settings):
    """Topics, where several would do; as the flags of ``belie check``."""

    image: str | None = Field(None, description="image topic")
    camera_info: str | None = Field(None, description="camera info topic")
    odometry: str | None = Field(None, description="odometry topic; 'none' leaves it out")
    position: str | None = Field(None, description="GNSS or localisation topic; 'none' leaves it out")
    imu: str | None = Field(None, description="IMU topic; 'none' leaves it out")
    detections: str | None = Field(None, description="detections topic; 'none' leaves them out")
    remap: dict[str, str] = Field(
        default_factory=dict, description="belie's name of a topic, read or written, to its name on the wire"
    )


class IntakeSettings(Settings):
    """How much waits when belie is late; what finds no place is dropped and counted."""

    frames: int = Field(1, description="[1] images waiting at most; the newest wins", ge=1)
    claims: int = Field(
        500, description="[1] messages of one claim topic waiting at most (1 kHz for half a second)", ge=1
    )
    awaited: tuple[Literal["odometry", "position", "imu", "detections"], ...] = Field(
        ("odometry", "imu"),
        description="streams whose claims a frame waits for, up to join.patience_ms: those that are compared at its "
        "very stamp; the others are judged at their own stamps, with a later frame if need be",
    )
    start_frames: int = Field(
        16, description="[1] images kept while the first messages of the other topics are awaited", ge=1
    )
    largest_image_px: int = Field(
        50_000_000, description="[px] images that claim more pixels are not even decoded", ge=1
    )
    settle_s: float = Field(
        2.0, description="[s] topics are chosen once no new one has appeared for this long", ge=0.0
    )
    first_message_s: float = Field(
        3.0,
        description="[s] a topic that was chosen but stays silent is not awaited longer than this",
        ge=0.0,
    )


class AnswerSettings(Settings):
    """Answers on the robot's own middleware."""

    diagnostics: str = Field(
        "/diagnostics", description="topic of diagnostic_msgs/DiagnosticArray; '' for none"
    )
    period_s: float = Field(
        1.0, description="[s] time between two of them where nothing changes; 0: one a frame", ge=0.0
    )
    stale_after_s: float = Field(
        1.0,
        description="[s] an input that has been silent for this long, and for five of its periods, is stale",
        gt=0.0,
    )
    alerts: str = Field(
        "/belie/alerts", description="topic of the alerts (DiagnosticArray, latched); '' for none"
    )
    alerts_kept: int = Field(50, description="[1] alerts in that message, the last ones", ge=1)
    annotated: str = Field("", description="topic of images with the verdict drawn in; '' for none")
    annotated_hz: float = Field(5.0, description="[1/s] at most so many of those", gt=0.0)


class EvidenceSettings(Settings):
    """What was received around an alert, kept as a bag."""

    folder: str = Field("", description="where bags go; '' for none")
    before_s: float = Field(10.0, description="[s] kept from before an alert", ge=0.0)
    after_s: float = Field(10.0, description="[s] and after it", ge=0.0)
    longest_s: float = Field(
        60.0, description="[s] a bag is closed after this long, however many alerts follow", gt=0.0
    )
    memory_mb: float = Field(512.0, description="[MB] memory for what waits; the oldest goes first", gt=0.0)
    quota_mb: float = Field(2048.0, description="[MB] of the folder; belie's oldest bags go first", gt=0.0)


class RetrySettings(Settings):
    """How a sink that fails is tried again."""

    first_s: float = Field(0.5, description="[s] pause after the first failure; it doubles", gt=0.0)
    longest_s: float = Field(30.0, description="[s] the longest pause", gt=0.0)
    waiting: int = Field(200, description="[1] answers waiting at most; the oldest go first", ge=1)


class MqttSettings(Settings):
    """Errors as a VDA 5050 ``state`` over MQTT."""

    host: str = Field("", description="broker; '' for none")
    port: int = Field(1883, description="its port", ge=1, le=65535)
    username: str = Field("", description="user; the password is read from the variable BELIE_MQTT_PASSWORD")
    tls: bool = Field(False, description="encrypt")
    interface: str = Field("belie", description="first part of the topic")
    manufacturer: str = Field("belie", description="as in the header of the message")
    serial: str = Field("monitor", description="serialNumber, likewise")
    period_s: float = Field(30.0, description="[s] VDA 5050 asks for a state at least this often", gt=0.0)


class WebhookSettings(Settings):
    """Alerts as JSON by HTTP POST."""

    url: str = Field("", description="where to; '' for none; a token is read from BELIE_WEBHOOK_TOKEN")
    timeout_s: float = Field(5.0, description="[s] for one request", gt=0.0)


class DdsSettings(Settings):
    """ROS 2 over DDS."""

    domain: int | None = Field(
        None, description="domain; by default that of ROS_DOMAIN_ID, else 0", ge=0, le=232
    )
    interface: str = Field("", description="network interface, e.g. lo or eth0; '' lets DDS choose")
    peers: tuple[str, ...] = Field((), description="addresses asked directly, where multicast does not reach")
    reliable: bool = Field(
        False,
        description="ask again for what is lost; a publisher that offers best effort only is then not heard",
    )
    receive_buffer_mb: float = Field(4.0, description="[MB] of the socket", gt=0.0)


class ZenohSettings(Settings):
    """ROS 2 over rmw_zenoh."""

    endpoint: str = Field("tcp/localhost:7447", description="router, tcp/HOST:PORT or tls/HOST:PORT")
    domain: int | None = Field(
        None, description="domain; by default that of ROS_DOMAIN_ID, else 0", ge=0, le=232
    )
    ca_file: str = Field("", description="root certificate for tls")


class Ros1Settings(Settings):
    """ROS 1."""

    master: str = Field("", description="its URI; by default ROS_MASTER_URI")
    node: str = Field("belie", description="name of our node")


class LiveSettings(Settings):
    """Settings of ``belie live``; ``[detector]`` is what ``belie config`` prints.

    Examples
    --------
    >>> LiveSettings().intake.frames, LiveSettings().join.patience_ms
    (1, 150.0)
    """

    topics: TopicSettings = TopicSettings()
    intake: IntakeSettings = IntakeSettings()
    # Offline, waiting costs nothing; here it is latency.
    join: JoinSettings = JoinSettings(reorder_window_ms=0.0, patience_ms=150.0)
    answers: AnswerSettings = AnswerSettings()
    evidence: EvidenceSettings = EvidenceSettings()
    metrics: str = Field("", description="HOST:PORT for Prometheus, e.g. 127.0.0.1:9464; '' for none")
    mqtt: MqttSettings = MqttSettings()
    webhook: WebhookSettings = WebhookSettings()
    retry: RetrySettings = RetrySettings()
    dds: DdsSettings = DdsSettings()
    zenoh: ZenohSettings = ZenohSettings()
    ros1: Ros1Settings = Ros1Settings()
    detector: Config = Config()


def parse_live_settings(values: dict[str, Any], origin: str = "live.toml") -> LiveSettings:
    """Check settings that came as plain values; what ``[join]`` leaves out keeps its default for live use.

    Raises
    ------
    ConfigError
        On an unknown key or a value out of range; the line names the key.

    Examples
    --------
    >>> parse_live_settings({"join": {"patience_ms": 10}}).join.reorder_window_ms
    0.0
    >>> parse_live_settings({"intake": {"frame": 2}})
    Traceback (most recent call last):
        ...
    belie.types.errors.ConfigError: live.toml: intake.frame: Extra inputs are not permitted
    """
    if isinstance(values.get("join"), dict):
        values = values | {"join": LiveSettings().join.model_dump() | values["join"]}
    return LiveSettings.checked(values, origin)


def load_live_settings(path: str | Path) -> dict[str, Any]:
    """The values of a TOML file, unchecked, so that flags can be laid over them.

    Raises
    ------
    ConfigError
        If the file is missing or no TOML.
    """
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read the configuration {path}: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path} is no TOML: {error}") from None
