"""ROS 2 over DDS, with cyclonedds and without ROS: names, types and QoS as ROS 2 has them."""

from __future__ import annotations

import os
import threading
import weakref
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

from belie.bridges.settings import DdsSettings
from belie.bridges.transports.dds_raw import raw_type, ros_type_name, sample
from belie.bridges.wire import Offer, Publisher, Receive, Received, now_ns, writer_depth
from belie.types import MissingExtraError, TransportError

_PREFIX = "rt"  # ROS 2 puts it before the names of topics
_POLICY = {
    2: "durability",
    4: "deadline",
    5: "latency budget",
    6: "ownership",
    8: "liveliness",
    10: "partition",
    11: "reliability",
    23: "data representation",
}  # numbers of the DDS specification

# Ending a domain ends every participant in it: it lasts as long as the process.
_DOMAINS: dict[int, Any] = {}


def domain_xml(settings: DdsSettings) -> str:
    """The configuration of cyclonedds.

    >>> "spdp" in domain_xml(DdsSettings()), "127.0.0.1" in domain_xml(DdsSettings(interface="lo"))
    (True, True)
    """
    local = settings.interface == "lo"
    multicast = "false" if local else "spdp"
    peers = [*settings.peers, *(["127.0.0.1"] if local else [])]
    interface = (
        f"<Interfaces><NetworkInterface name={quoteattr(settings.interface)} "
        f'multicast="{"false" if local else "default"}"/></Interfaces>'
        if settings.interface
        else ""
    )
    listed = "".join(f"<Peer address={quoteattr(peer)}/>" for peer in peers)
    return (
        f'<CycloneDDS><Domain id="any"><General>{interface}<AllowMulticast>{multicast}</AllowMulticast>'
        f"<MaxMessageSize>65500B</MaxMessageSize></General><Discovery>"
        f"<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>"
        + (f"<Peers>{listed}</Peers>" if peers else "")
        + f'</Discovery><Internal><SocketReceiveBufferSize min="default" max="{settings.receive_buffer_mb:g}MB"/>'
        "</Internal></Domain></CycloneDDS>"
    )


@dataclass(slots=True, eq=False)
class _Subscription:
    topic: str
    message_type: str
    receive: Receive
    reader: Any
    condition: Any
    depth: int


class _DdsPublisher:
    """Writes as long as its transport keeps the writer: the topic must end with the session that announced it."""

    def __init__(self, kind: Any, writer: Any) -> None:
        self._kind, self._writer = kind, weakref.ref(writer)

    def publish(self, data: bytes) -> None:
        writer = self._writer()
        if writer is not None:
            writer.write(sample(self._kind, data))


class DdsTransport:
    """A DDS participant; see `Transport`. ``CYCLONEDDS_URI``, where it is set, overrules interface and peers.

    Raises
    ------
    MissingExtraError
        Without cyclonedds.
    TransportError
        If the domain cannot be joined.
    """

    name = "dds"

    def __init__(self, settings: DdsSettings, *, domain: int) -> None:
        try:
            from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
            from cyclonedds.core import DDSException, GuardCondition, WaitSet
            from cyclonedds.domain import Domain, DomainParticipant
        except ImportError:
            raise MissingExtraError("cyclonedds", "live") from None
        self._settings = settings
        if not os.environ.get("CYCLONEDDS_URI") and domain not in _DOMAINS:
            try:
                _DOMAINS[domain] = Domain(domain, domain_xml(settings))
            except DDSException as error:
                raise TransportError(f"DDS domain {domain} cannot be set up: {error}") from None
        try:
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            where = f" on interface {settings.interface!r}" if settings.interface else ""
            raise TransportError(f"DDS domain {domain} cannot be joined{where}: {error}") from None
        self._guid = self._participant.guid
        self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._waitset = WaitSet(self._participant)
        self._guard = GuardCondition(self._participant)
        self._waitset.attach(self._guard)
        self._topics: dict[tuple[str, str], tuple[Any, Any]] = {}
        self._subscriptions: list[_Subscription] = []
        self._writers: dict[str, Any] = {}
        self._faults: dict[str, str] = {}
        self._lost: Counter[str] = Counter()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="belie-dds", daemon=True)
        self._thread.start()

    def offers(self) -> tuple[Offer, ...]:
        """What others publish now; see `Transport`."""
        from cyclonedds.core import InstanceState

        found: dict[tuple[str, str], list[Any]] = {}
        for endpoint in self._publications.read(10_000):
            if endpoint.sample_info.instance_state != InstanceState.Alive:
                continue
            prefix, _, rest = endpoint.topic_name.partition("/")
            message_type = ros_type_name(endpoint.type_name)
            if prefix != _PREFIX or message_type is None or endpoint.participant_key == self._guid:
                continue
            found.setdefault((f"/{rest}", message_type), []).append(endpoint.qos)
        return tuple(
            Offer(
                topic=topic,
                message_type=message_type,
                publishers=len(several),
                reliable=any("Reliable" in str(qos["Reliability"]) for qos in map(_by_name, several)),
                latched=any("TransientLocal" in str(qos["Durability"]) for qos in map(_by_name, several)),
            )
            for (topic, message_type), several in sorted(found.items())
        )

    def _topic(self, topic: str, message_type: str) -> tuple[Any, Any]:
        from cyclonedds.core import DDSException
        from cyclonedds.topic import Topic

        key = (topic, message_type)
        if key not in self._topics:
            kind = raw_type(message_type)
            try:
                entity = Topic(self._participant, f"{_PREFIX}{topic}", kind)
            except DDSException as error:
                raise TransportError(f"{topic} cannot be used as {message_type}: {error}") from None
            self._topics[key] = (kind, entity)
        return self._topics[key]

    def _qos(self, *, reliable: bool, latched: bool, depth: int) -> Any:
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.util import duration

        history = Policy.History.KeepLast(depth)
        policies = [
            Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
            Policy.Reliability.Reliable(duration(milliseconds=100))
            if reliable
            else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
            history,
        ]
        if latched:  # who comes late gets as many as this says, and by default one
            policies.append(Policy.DurabilityService(duration(seconds=0), history, -1, -1, -1))
        return Qos(*policies)

    def subscribe(
        self, topic: str, message_type: str, receive: Receive, *, latched: bool, depth: int
    ) -> None:
        """Subscribe; see `Transport`. Images and claims come best effort, as sensor data do in ROS 2."""
        from cyclonedds.core import InstanceState, Listener, ReadCondition, SampleState, ViewState
        from cyclonedds.sub import DataReader

        _, entity = self._topic(topic, message_type)
        listener: Any = Listener()

        def incompatible(_: Any, status: Any) -> None:
            policy = _POLICY.get(int(status.last_policy_id), f"policy {status.last_policy_id}")
            self._faults[topic] = f"a publisher of {topic} offers another {policy} than is asked for"

        def lost(_: Any, status: Any) -> None:
            self._lost[topic] += max(0, int(status.total_count_change))

        listener.set_on_requested_incompatible_qos(incompatible)
        listener.set_on_sample_lost(lost)
        qos = self._qos(reliable=latched or self._settings.reliable, latched=latched, depth=depth)
        reader = DataReader(self._participant, entity, qos=qos, listener=listener)
        condition = ReadCondition(reader, ViewState.Any | SampleState.NotRead | InstanceState.Alive)
        self._subscriptions.append(_Subscription(topic, message_type, receive, reader, condition, depth))
        self._waitset.attach(condition)

    def advertise(self, topic: str, message_type: str, *, latched: bool) -> Publisher:
        """Announce a topic; see `Transport`."""
        from cyclonedds.pub import DataWriter

        kind, entity = self._topic(topic, message_type)
        qos = self._qos(reliable=True, latched=latched, depth=writer_depth(message_type, latched=latched))
        self._writers[topic] = DataWriter(self._participant, entity, qos=qos)
        return _DdsPublisher(kind, self._writers[topic])

    def subscribers(self, topic: str) -> int:
        """How many listen; see `Transport`."""
        writer = self._writers.get(topic)
        return 0 if writer is None else len(writer.get_matched_subscriptions())

    def lost(self) -> Mapping[str, int]:
        """Messages that were sent and never came, by topic."""
        return dict(self._lost)

    def faults(self) -> Mapping[str, str]:
        """QoS that does not match, by topic."""
        return dict(self._faults)

    def reset(self) -> None:
        """Drop subscriptions and topics of ours."""
        while self._subscriptions:
            self._waitset.detach(self._subscriptions.pop().condition)
        self._writers.clear()
        self._faults.clear()

    def close(self) -> None:
        """Leave the network."""
        self._stop.set()
        self._guard.set(True)
        self._thread.join(2.0)
        self.reset()
        self._topics.clear()
        del self._waitset, self._guard, self._publications, self._participant

    def _run(self) -> None:
        from cyclonedds.util import duration

        while not self._stop.is_set():
            try:
                self._waitset.wait(duration(milliseconds=500))
                for subscription in list(self._subscriptions):
                    self._drain(subscription)
            except Exception as error:  # whatever it is, the next message may be fine
                self._faults[""] = f"DDS: {type(error).__name__}: {error}"
                self._stop.wait(0.05)

    def _drain(self, subscription: _Subscription) -> None:
        for taken in subscription.reader.take(subscription.depth):
            data = getattr(taken, "data", None)
            if data is None:
                continue  # a publisher has gone: no message
            subscription.receive(
                Received(
                    topic=subscription.topic,
                    message_type=subscription.message_type,
                    data=data,
                    received_ns=now_ns(),
                )
            )


def _by_name(qos: Any) -> dict[str, str]:
    """The policies of a QoS by their names, as text."""
    found = {"Reliability": "", "Durability": ""}
    for policy in qos:
        text = str(policy)
        for name in found:
            if f"Policy.{name}." in text:
                found[name] = text
    return found
