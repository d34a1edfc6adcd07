"""``belie attack --live``: the paper's channel hijack. Takes a topic, alters it, sends it on under another name."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from belie.attacks import AttackSpec, FrameClock, RunningAttack, attacked_streams
from belie.bridges.discovery import discover
from belie.bridges.intake import Intake
from belie.bridges.introduction import TF_STATIC, Introduction
from belie.bridges.settings import LiveSettings
from belie.bridges.wire import Publisher, Received, Transport
from belie.recordings import topics as ros
from belie.recordings.claims import FixReader, stamp_ns
from belie.recordings.first_messages import decode_message
from belie.recordings.images import GrayDecoder
from belie.recordings.messages import STORE, image
from belie.recordings.rig import ClaimReader, Rig, claim_reader
from belie.types import AttackError, BelieError, Frame, MountedCamera

_FRAMES = 1_000_000  # nine hours at 30 Hz
_IDLE_S = 0.05
_PERIODS = 5  # frames from which the camera's period is taken
_QUEUE = 10_000
_JPEG_QUALITY = 95


def attacked_name(topic: str) -> str:
    """The name under which an attacked topic goes on.

    >>> attacked_name("/odom"), attacked_name("/cam/image_raw/compressed")
    ('/odom_attacked', '/cam/image_raw_attacked/compressed')
    """
    base = ros.camera_name(topic)
    return f"{base}_attacked{topic.removeprefix(base)}"


class Hijack:
    """Attacks a running robot's topics.

    Parameters
    ----------
    transport : Transport
        Open.
    settings : LiveSettings
        Topics and waiting times.
    specs : list of AttackSpec
        The attacks; their starts count from the first frame after `run` says that it is ready.
    names : mapping of str to str
        Topic to the name under which it goes on, where that is not `attacked_name`.
    on_event : callable
        Is told what happens, a line at a time.

    Attributes
    ----------
    altered : int
        How many messages went on altered.
    """

    def __init__(
        self,
        transport: Transport,
        settings: LiveSettings,
        specs: list[AttackSpec],
        *,
        names: Mapping[str, str],
        on_event: Callable[[str], None],
    ) -> None:
        self._transport, self._settings, self._specs = transport, settings, specs
        self._names, self._on_event = names, on_event
        self._stop = threading.Event()
        self._publishers: dict[str, Publisher] = {}
        self._readers: dict[str, ClaimReader | None] = {}
        self._stamps: list[int] = []
        self._attack: RunningAttack | None = None
        self.altered = 0

    def stop(self) -> None:
        """End; may be called from a signal handler."""
        self._stop.set()

    def run(self) -> None:
        """Attack until stopped.

        Raises
        ------
        AttackError
            If the robot has no topic of an attacked stream, or an attack makes no sense on it.
        """
        choice = discover(
            self._transport,
            self._settings.topics,
            self._settings.intake,
            stopped=self._stop.is_set,
            on_waiting=self._on_event,
        )
        if choice is None:
            return
        topics = _topics(choice, self._specs)
        for topic in topics.values():
            name = self._names.get(topic.name, attacked_name(topic.name))
            self._publishers[topic.name] = self._transport.advertise(name, topic.message_type, latched=False)
            self._on_event(f"{topic.name} goes on as {name}")
        # Nothing is dropped while it passes through: what goes in must come out.
        intake = Intake(choice.image.name, frames=_QUEUE, claims=_QUEUE)
        introduction = Introduction(choice, info_by_name=self._settings.topics.camera_info is not None)
        self._transport.subscribe(TF_STATIC, ros.TRANSFORMS, intake.receive, latched=True, depth=100)
        for topic in {t.name: t for t in (choice.image, choice.camera_info, *choice.claims)}.values():
            self._transport.subscribe(
                topic.name, topic.message_type, intake.receive, latched=False, depth=1000
            )
        decoder = GrayDecoder(choice.image.name)
        while not self._stop.is_set():
            for received in intake.take(_IDLE_S):
                data = received.data
                try:
                    data = self._altered(received, introduction, decoder)
                except AttackError:
                    raise
                except Exception as error:  # what cannot be read goes on as it is
                    self._on_event(f"{received.topic} passes unread: {error}")
                if received.topic in self._publishers:
                    self._publishers[received.topic].publish(data)

    def _altered(self, received: Received, introduction: Introduction, decoder: GrayDecoder) -> bytes:
        choice, topic = introduction.choice, received.topic
        is_image = topic == choice.image.name
        attacks_images = is_image and topic in self._publishers
        if self._attack is not None and topic not in self._publishers and topic != _odometry(choice):
            return received.data
        message = STORE.deserialize_cdr(received.data, received.message_type)
        if topic == TF_STATIC:
            introduction.frames.add_message(message)
        elif topic == choice.camera_info.name:
            introduction.hear_info(message)
        elif self._attack is None:
            if is_image:
                self._hear_image(message, introduction, decoder)
            else:
                introduction.hear_claim(topic, message)
            self._try_to_begin(introduction)
        if self._attack is None:
            return received.data
        if attacks_images:
            return self._altered_image(received, message, decoder)
        if topic in self._publishers or topic == _odometry(choice):
            return self._altered_claims(received, message, introduction)
        return received.data

    def _hear_image(self, message: Any, introduction: Introduction, decoder: GrayDecoder) -> None:
        if introduction.image_size is None:
            picture = decode_message(decoder, message)
            introduction.hear_image(message.header.frame_id, (picture.shape[1], picture.shape[0]))
        self._stamps = [*self._stamps[-_PERIODS:], stamp_ns(message)]

    def _try_to_begin(self, introduction: Introduction) -> None:
        if not introduction.knows_camera or len(self._stamps) <= _PERIODS:
            return
        try:
            camera: MountedCamera | None = introduction.camera()
        except BelieError as error:
            self._on_event(f"the camera's place is not known ({error})")
            camera = None
        period_ns = (self._stamps[-1] - self._stamps[0]) // (len(self._stamps) - 1)
        if period_ns <= 0:
            raise AttackError("image stamps stand still, so that frames cannot be counted")
        clock = FrameClock.steady(self._stamps[-1], period_ns, _FRAMES)
        self._attack = RunningAttack(self._specs, clock, introduction.rig().body_axes, camera)
        self._on_event(
            f"ready: frame 0 is the image stamped {self._stamps[-1]} ns, {1e9 / period_ns:.1f} a second"
        )

    def _altered_image(self, received: Received, message: Any, decoder: GrayDecoder) -> bytes:
        if self._attack is None:
            return received.data
        frame = Frame(
            camera=decoder.topic,
            stamp_ns=stamp_ns(message),
            received_ns=received.received_ns,
            image=decode_message(decoder, message),
        )
        forged = self._attack.forge_frame(frame)
        if forged is frame:
            return received.data
        self.altered += 1
        encoding = "mono8" if received.message_type == ros.IMAGE else "jpeg"
        lie = image(forged.image, frame.stamp_ns, message.header.frame_id, encoding, _JPEG_QUALITY)
        return bytes(STORE.serialize_cdr(lie, received.message_type))

    def _altered_claims(self, received: Received, message: Any, introduction: Introduction) -> bytes:
        from belie.bridges.rewriting import rewritten

        rig = introduction.rig()
        reader = self._reader(received.topic, message, introduction, rig)
        if reader is None or self._attack is None:
            return received.data
        claims = reader(message, received.received_ns, 0)
        lies = tuple(self._attack.forge(claim) for claim in claims)
        if all(lie is claim for lie, claim in zip(lies, claims, strict=True)):
            return received.data
        self.altered += 1
        origin = reader.origin if isinstance(reader, FixReader) else None
        lie = rewritten(message, received.message_type, lies, rig, origin)
        return bytes(STORE.serialize_cdr(lie, received.message_type))

    def _reader(self, topic: str, message: Any, introduction: Introduction, rig: Rig) -> ClaimReader | None:
        if self._readers.get(topic) is None:
            choice = introduction.choice
            chosen = next(one for one in choice.claims if one.name == topic)
            as_odometry = chosen is choice.odometry
            self._readers[topic] = claim_reader(rig, chosen, as_odometry=as_odometry, first=message)
        return self._readers[topic]


def _odometry(choice: ros.Choice) -> str:
    """The odometry's topic: attacks on positions take the heading from it."""
    return choice.odometry.name if choice.odometry is not None else ""


def _topics(choice: ros.Choice, specs: list[AttackSpec]) -> dict[str, ros.Topic]:
    parts = {
        "odometry": choice.odometry,
        "position": choice.position,
        "imu": choice.imu,
        "detections": choice.detections,
        "camera": choice.image,
    }
    found: dict[str, ros.Topic] = {}
    for stream in attacked_streams(specs):
        topic = parts[stream]
        if topic is None:
            raise AttackError(f"the robot has no topic of the attacked stream: {stream}")
        found[stream] = topic
    return found
