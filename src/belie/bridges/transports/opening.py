"""From a name and the settings to an open transport."""

from __future__ import annotations

import os
from enum import StrEnum

from belie.bridges.settings import LiveSettings
from belie.bridges.transports.remapped import Remapped
from belie.bridges.wire import Transport


class TransportName(StrEnum):
    """The middlewares that belie speaks."""

    DDS = "dds"
    ZENOH = "zenoh"
    ROS1 = "ros1"


def open_transport(name: TransportName, settings: LiveSettings) -> Transport:
    """Join the network.

    Raises
    ------
    MissingExtraError
        If the middleware's library is not installed.
    TransportError
        If the network cannot be joined.
    """
    transport: Transport
    match name:
        case TransportName.DDS:
            from belie.bridges.transports.dds import DdsTransport

            transport = DdsTransport(settings.dds, domain=domain_of(settings.dds.domain))
        case TransportName.ZENOH:
            from belie.bridges.transports.zenoh import ZenohTransport

            transport = ZenohTransport(settings.zenoh, domain=domain_of(settings.zenoh.domain))
        case TransportName.ROS1:
            from belie.bridges.transports.ros1 import Ros1Transport

            transport = Ros1Transport(settings.ros1)
    return Remapped(transport, settings.topics.remap) if settings.topics.remap else transport


def domain_of(setting: int | None) -> int:
    """The ROS domain: as set, else by ROS_DOMAIN_ID, else 0.

    >>> domain_of(7)
    7
    """
    if setting is not None:
        return setting
    text = os.environ.get("ROS_DOMAIN_ID", "")
    return int(text) if text.isdigit() else 0
