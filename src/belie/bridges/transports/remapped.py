"""Topics under other names on the wire."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from belie.bridges.wire import Offer, Publisher, Receive, Received, Transport


class Remapped:
    """A transport on which some topics have another name than belie calls them.

    Parameters
    ----------
    transport : Transport
        The one below.
    remap : mapping of str to str
        belie's name to the name on the wire.
    """

    def __init__(self, transport: Transport, remap: Mapping[str, str]) -> None:
        self.name = transport.name
        self._transport = transport
        self._out = dict(remap)
        self._in = {wire: ours for ours, wire in remap.items()}

    def offers(self) -> tuple[Offer, ...]:
        """What others publish, by belie's names; a topic whose name is taken by another one is hidden."""
        return tuple(
            replace(offer, topic=self._in.get(offer.topic, offer.topic))
            for offer in self._transport.offers()
            if offer.topic in self._in or offer.topic not in self._out
        )

    def subscribe(
        self, topic: str, message_type: str, receive: Receive, *, latched: bool, depth: int
    ) -> None:
        """As below, under the other name."""

        def renamed(message: Received) -> None:
            receive(
                Received(
                    topic=topic, message_type=message_type, data=message.data, received_ns=message.received_ns
                )
            )

        self._transport.subscribe(
            self._out.get(topic, topic), message_type, renamed, latched=latched, depth=depth
        )

    def advertise(self, topic: str, message_type: str, *, latched: bool) -> Publisher:
        """As below, under the other name."""
        return self._transport.advertise(self._out.get(topic, topic), message_type, latched=latched)

    def subscribers(self, topic: str) -> int:
        """As below, under the other name."""
        return self._transport.subscribers(self._out.get(topic, topic))

    def lost(self) -> Mapping[str, int]:
        """As below, by belie's names."""
        return {self._in.get(topic, topic): count for topic, count in self._transport.lost().items()}

    def faults(self) -> Mapping[str, str]:
        """As below, by belie's names."""
        return {self._in.get(topic, topic): text for topic, text in self._transport.faults().items()}

    def reset(self) -> None:
        """As below."""
        self._transport.reset()

    def close(self) -> None:
        """Leave the network."""
        self._transport.close()
