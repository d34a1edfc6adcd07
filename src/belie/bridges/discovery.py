"""Which topics play which part on a running robot: waits until it is clear."""

from __future__ import annotations

import time
from collections.abc import Callable

from belie.bridges.settings import IntakeSettings, TopicSettings
from belie.bridges.wire import Offer, Transport
from belie.recordings import topics as ros
from belie.types import AmbiguousTopicError, TopicError

_LOOK_S = 0.1


def topics_of(offers: tuple[Offer, ...]) -> list[ros.Topic]:
    """Offers as the topics of a bag, so that the same rules choose among them.

    Our own answers are no input, should another belie publish them; neither is what has two types.

    >>> topics_of((Offer(topic="/odom", message_type=ros.ODOMETRY),))[0].role
    'odometry'
    """
    return [
        ros.Topic(name=offer.topic, message_type=offer.message_type, count=offer.publishers)
        for offer in offers
        if not offer.topic.startswith("/belie/")
    ]


def choose_now(offers: tuple[Offer, ...], named: TopicSettings) -> ros.Choice:
    """Choose among what is offered now; raises `TopicError` as `belie.recordings.topics.choose` does."""
    return ros.choose(
        topics_of(offers),
        image=named.image,
        camera_info=named.camera_info,
        odometry=named.odometry,
        position=named.position,
        imu=named.imu,
        detections=named.detections,
    )


def discover(
    transport: Transport,
    named: TopicSettings,
    settings: IntakeSettings,
    *,
    stopped: Callable[[], bool],
    on_waiting: Callable[[str], None],
) -> ros.Choice | None:
    """Wait until topics can be chosen and no new one has appeared for a while; None where stopped before.

    Raises
    ------
    AmbiguousTopicError
        If several topics would do, once no new one appears: waiting does not help.
    """
    seen: tuple[Offer, ...] | None = None
    steady_since_s = time.monotonic()
    said = ""
    while not stopped():
        offers = transport.offers()
        if offers != seen:
            seen, steady_since_s = offers, time.monotonic()
        settled = time.monotonic() - steady_since_s >= settings.settle_s
        try:
            choice = choose_now(offers, named)
        except AmbiguousTopicError:
            if settled:
                raise
        except TopicError as error:
            if settled and str(error) != said:
                said = str(error)
                on_waiting(said)
        else:
            if settled:
                return choice
        time.sleep(_LOOK_S)
    return None


def list_offers(transport: Transport, settle_s: float, longest_s: float = 10.0) -> tuple[Offer, ...]:
    """What is offered, once nothing new has appeared for `settle_s`."""
    began_s = steady_since_s = time.monotonic()
    offers = transport.offers()
    while time.monotonic() - steady_since_s < settle_s and time.monotonic() - began_s < longest_s:
        time.sleep(_LOOK_S)
        if (now := transport.offers()) != offers:
            offers, steady_since_s = now, time.monotonic()
    return offers
