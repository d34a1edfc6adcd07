"""Names on rmw_zenoh's network: keys of topics, and the liveliness tokens by which publishers are found.

After the design page of rmw_zenoh (design.md, "Topic and service name mapping" and "Graph cache").
"""

from __future__ import annotations

from functools import cache

from belie.bridges.transports.dds_raw import dds_type_name, ros_type_name
from belie.bridges.wire import Offer
from belie.recordings.messages import STORE
from belie.recordings.vision_messages import VISION_TYPES

assert VISION_TYPES  # importing registers them with STORE

_RELIABLE, _TRANSIENT_LOCAL = "1", "1"


@cache
def type_hash(message_type: str) -> str:
    """RIHS01 hash of a message type (REP 2011).

    >>> type_hash("std_msgs/msg/String")[:14]
    'RIHS01_df668c7'
    """
    return str(STORE.hash_rihs01(message_type))


def topic_key(domain: int, topic: str, message_type: str, hash_text: str) -> str:
    """Key of a topic; ``*`` for the hash matches all.

    >>> topic_key(0, "/chatter", "std_msgs/msg/String", "*")
    '0/chatter/std_msgs::msg::dds_::String_/*'
    """
    return f"{domain}/{topic.strip('/')}/{dds_type_name(message_type)}/{hash_text}"


def publisher_token(
    domain: int, zid: str, entity: int, kind: str, topic: str, message_type: str, *, latched: bool
) -> str:
    """Liveliness token of a publisher (kind MP) or subscriber (MS) of node ``belie``.

    >>> publisher_token(0, "ab", 3, "MP", "/a/b", "std_msgs/msg/String", latched=True).split("/")[5:10]
    ['MP', '%', '%', 'belie', '%a%b']
    """
    name = topic.replace("/", "%")
    qos = ":1:,10:,:,:,," if latched else "::,10:,:,:,,"
    kind_name = dds_type_name(message_type)
    return f"@ros2_lv/{domain}/{zid}/0/{entity}/{kind}/%/%/belie/{name}/{kind_name}/{type_hash(message_type)}/{qos}"


def offer_of(token: str) -> tuple[str, Offer] | None:
    """Session id and offer that a publisher's token tells; None for other tokens.

    >>> offer_of("@ros2_lv/0/ab/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/RIHS01_d/::,7:,:,:,,")[1].topic
    '/chatter'
    """
    parts = token.split("/")
    if len(parts) != 13 or parts[5] != "MP":
        return None
    message_type = ros_type_name(parts[10])
    if message_type is None:
        return None
    reliability, durability, *_ = [*parts[12].split(":"), "", ""]
    return parts[2], Offer(
        topic=parts[9].replace("%", "/"),
        message_type=message_type,
        reliable=reliability in ("", _RELIABLE),  # rmw_zenoh leaves its defaults out
        latched=durability == _TRANSIENT_LOCAL,
    )
