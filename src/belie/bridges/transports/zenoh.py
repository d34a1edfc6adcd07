"""ROS 2 over rmw_zenoh: a client of its router, with the same keys, attachments and liveliness tokens."""

from __future__ import annotations

import itertools
import json
import os
import struct
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from belie.bridges.settings import ZenohSettings
from belie.bridges.transports.zenoh_names import offer_of, publisher_token, topic_key, type_hash
from belie.bridges.wire import Offer, Publisher, Receive, Received, now_ns, writer_depth
from belie.types import ConfigError, MissingExtraError, TransportError

_QUERY_S = 1.0
_DROP_AFTER_US = 50_000  # Zenoh's own 1 ms loses messages whenever the machine is busy for that long


def attachment(sequence: int, gid: bytes) -> bytes:
    """What rmw_zenoh expects beside a message: sequence number, source time, 16 bytes that name the publisher.

    >>> len(attachment(1, bytes(16)))
    33
    """
    return struct.pack("<qqB", sequence, time.time_ns(), len(gid)) + gid


class _ZenohPublisher:
    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher
        self._sequence = itertools.count(1)
        self._gid = os.urandom(16)

    def publish(self, data: bytes) -> None:
        self._publisher.put(data, attachment=attachment(next(self._sequence), self._gid))


class ZenohTransport:
    """A Zenoh session in client mode; see `Transport`.

    Raises
    ------
    MissingExtraError
        Without eclipse-zenoh.
    TransportError
        If the router does not answer.
    """

    name = "zenoh"

    def __init__(self, settings: ZenohSettings, *, domain: int) -> None:
        try:
            import zenoh
        except ImportError:
            raise MissingExtraError("eclipse-zenoh", "live") from None
        if not settings.endpoint.startswith(("tcp/", "tls/")):
            raise ConfigError(
                f"zenoh.endpoint {settings.endpoint!r}: expected tcp/HOST:PORT or tls/HOST:PORT"
            )
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([settings.endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("timestamping/enabled", "true")  # the cache of latched topics needs it
        config.insert_json5(
            "transport/link/tx/queue/congestion_control/drop/wait_before_drop", str(_DROP_AFTER_US)
        )
        if settings.ca_file:
            config.insert_json5("transport/link/tls/root_ca_certificate", json.dumps(settings.ca_file))
        try:
            self._session: Any = zenoh.open(config)
        except zenoh.ZError as error:
            said = " ".join(str(error).split())[:160]
            raise TransportError(f"no Zenoh router at {settings.endpoint}: {said}") from None
        self._domain = domain
        self._zid = str(self._session.zid())
        self._entities = itertools.count(1)
        self._held: list[Any] = []
        self._publishers: dict[str, Any] = {}
        self._tokens: set[str] = set()
        self._lock = threading.Lock()
        self._held.append(
            self._session.liveliness().declare_subscriber(
                f"@ros2_lv/{domain}/**", self._note_token, history=True
            )
        )

    def _note_token(self, sample: Any) -> None:
        import zenoh

        token = str(sample.key_expr)
        with self._lock:
            if sample.kind == zenoh.SampleKind.PUT:
                self._tokens.add(token)
            else:
                self._tokens.discard(token)

    def offers(self) -> tuple[Offer, ...]:
        """What others publish now; see `Transport`."""
        with self._lock:
            tokens = list(self._tokens)
        merged: dict[tuple[str, str], Offer] = {}
        for found in map(offer_of, tokens):
            if found is None or found[0] == self._zid:
                continue
            offer = found[1]
            known = merged.get((offer.topic, offer.message_type))
            if known is not None:
                offer = replace(
                    offer,
                    publishers=known.publishers + 1,
                    reliable=known.reliable or offer.reliable,
                    latched=known.latched or offer.latched,
                )
            merged[offer.topic, offer.message_type] = offer
        return tuple(merged[key] for key in sorted(merged))

    def subscribe(
        self, topic: str, message_type: str, receive: Receive, *, latched: bool, depth: int
    ) -> None:
        """Subscribe; see `Transport`. Zenoh hands messages on at once, so `depth` has no meaning."""
        import zenoh.ext

        def handle(sample: Any) -> None:
            receive(
                Received(
                    topic=topic,
                    message_type=message_type,
                    data=sample.payload.to_bytes(),
                    received_ns=now_ns(),
                )
            )

        key = topic_key(self._domain, topic, message_type, "*")
        if latched:
            history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            self._held.append(
                zenoh.ext.declare_advanced_subscriber(self._session, key, handle, history=history)
            )
        else:
            self._held.append(self._session.declare_subscriber(key, handle))
        self._announce("MS", topic, message_type, latched=latched)

    def advertise(self, topic: str, message_type: str, *, latched: bool) -> Publisher:
        """Announce a topic; see `Transport`."""
        import zenoh
        import zenoh.ext

        key = topic_key(self._domain, topic, message_type, type_hash(message_type))
        # A peer that is slow must not block us for long.
        options: dict[str, Any] = {
            "congestion_control": zenoh.CongestionControl.DROP,
            "reliability": zenoh.Reliability.RELIABLE,
        }
        if latched:
            depth = writer_depth(message_type, latched=True)
            publisher: Any = zenoh.ext.declare_advanced_publisher(
                self._session,
                key,
                cache=zenoh.ext.CacheConfig(max_samples=depth),
                publisher_detection=True,
                **options,
            )
        else:
            publisher = self._session.declare_publisher(key, **options)
            self._publishers[topic] = publisher
        self._held.append(publisher)
        self._announce("MP", topic, message_type, latched=latched)
        return _ZenohPublisher(publisher)

    def _announce(self, kind: str, topic: str, message_type: str, *, latched: bool) -> None:
        token = publisher_token(
            self._domain, self._zid, next(self._entities), kind, topic, message_type, latched=latched
        )
        self._held.append(self._session.liveliness().declare_token(token))

    def subscribers(self, topic: str) -> int:
        """How many listen; see `Transport`. Their tokens may come before messages find their way to them."""
        publisher = self._publishers.get(topic)
        if publisher is not None and not publisher.matching_status.matching:
            return 0
        name = topic.replace("/", "%")
        with self._lock:
            split = [token.split("/") for token in self._tokens]
        return sum(
            1
            for part in split
            if len(part) == 13 and part[5] == "MS" and part[9] == name and part[2] != self._zid
        )

    def lost(self) -> Mapping[str, int]:
        """TCP loses nothing on its way, and the middleware does not tell what it drops itself."""
        return {}

    def faults(self) -> Mapping[str, str]:
        """Zenoh has no QoS that would not match."""
        return {}

    def reset(self) -> None:
        """Drop subscriptions and topics of ours; the one that finds publishers stays."""
        self._publishers.clear()
        while len(self._held) > 1:
            self._held.pop().undeclare()

    def close(self) -> None:
        """Leave the network."""
        self._held.clear()
        self._session.close()
