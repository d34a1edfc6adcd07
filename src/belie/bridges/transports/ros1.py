"""ROS 1, with Debian's rospy: messages arrive as ROS 1 bytes and are re-laid as CDR.

The packages (``apt install python3-rospy python3-rosmaster``) belong to the system's Python; from a virtual
environment their folder is added to the end of the path.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from belie.bridges.settings import Ros1Settings
from belie.bridges.wire import Offer, Publisher, Receive, Received, now_ns, writer_depth
from belie.recordings.messages import STORE
from belie.recordings.topics import TRANSFORMS
from belie.recordings.vision_messages import VISION_TYPES
from belie.types import TransportError

_DEBIAN = Path("/usr/lib/python3/dist-packages")


def _rospy() -> Any:
    try:
        import rospy
    except ImportError:
        if str(_DEBIAN) not in sys.path and (_DEBIAN / "rospy").is_dir():
            sys.path.append(str(_DEBIAN))
        try:
            import rospy
        except ImportError as error:
            raise TransportError(
                f"ROS 1 needs rospy ({error}); run: apt install python3-rospy, and pip install 'belie[live]'"
            ) from None
    return rospy


def ros1_type(message_type: str) -> str:
    """ROS 2's name of a type to ROS 1's.

    >>> ros1_type("nav_msgs/msg/Odometry")
    'nav_msgs/Odometry'
    """
    return message_type.replace("/msg/", "/")


def ros2_type(message_type: str) -> str:
    """ROS 1's name of a type to ROS 2's.

    >>> ros2_type("nav_msgs/Odometry")
    'nav_msgs/msg/Odometry'
    """
    package, _, name = message_type.partition("/")
    return f"{package}/msg/{name}"


class _Ros1Publisher:
    def __init__(self, kind: Any, publisher: Any, message_type: str) -> None:
        self._kind, self._publisher, self._message_type = kind, publisher, message_type

    def publish(self, data: bytes) -> None:
        message = self._kind()
        message._buff = bytes(STORE.cdr_to_ros1(data, self._message_type))
        self._publisher.publish(message)


class Ros1Transport:
    """A ROS 1 node; see `Transport`. A process can be one node only.

    Raises
    ------
    TransportError
        Without rospy, or if the master does not answer.
    """

    name = "ros1"

    def __init__(self, settings: Ros1Settings) -> None:
        if settings.master:
            os.environ["ROS_MASTER_URI"] = settings.master
        os.environ.setdefault("ROS_MASTER_URI", "http://localhost:11311")
        self._rospy = _rospy()
        import rosgraph

        uri = os.environ["ROS_MASTER_URI"]
        self._master = rosgraph.Master(f"/{settings.node}")
        try:
            self._master.getPid()
        except Exception as error:  # sockets, XML-RPC, name look-up: all mean the same here
            raise TransportError(f"no ROS 1 master at {uri}: {error}") from None
        if not self._rospy.core.is_initialized():
            self._rospy.init_node(settings.node, anonymous=True, disable_signals=True)
        # For definitions and their MD5 sums; bytes are converted by the types of ROS 2, whose header has no `seq`.
        self._store = get_typestore(Stores.ROS1_NOETIC)
        self._store.register(VISION_TYPES)
        self._store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
        self._subscribers: list[Any] = []
        self._publishers: dict[str, Any] = {}
        self._faults: dict[str, str] = {}
        self._lock = threading.Lock()

    def offers(self) -> tuple[Offer, ...]:
        """What others publish now; see `Transport`."""
        try:
            publishers, _, _ = self._master.getSystemState()
            types = dict(self._master.getTopicTypes())
        except Exception as error:  # the master restarts: look again later
            self._faults[""] = f"the ROS 1 master does not answer: {error}"
            return ()
        self._faults.pop("", None)
        me = self._rospy.get_name()
        found = []
        for topic, nodes in sorted(publishers):
            others = [node for node in nodes if node != me]
            kind = types.get(topic, "*")
            if others and "/" in kind:
                found.append(Offer(topic=topic, message_type=ros2_type(kind), publishers=len(others)))
        return tuple(found)

    def subscribe(
        self, topic: str, message_type: str, receive: Receive, *, latched: bool, depth: int
    ) -> None:
        """Subscribe; see `Transport`. rospy asks for any type, so that another one can be named."""
        wanted = ros1_type(message_type)
        _, md5 = self._store.generate_msgdef(message_type, ros_version=1)

        def handle(message: Any) -> None:
            received_ns = now_ns()
            kind = message._connection_header["type"]
            if kind.replace("tf/tfMessage", "tf2_msgs/TFMessage") != wanted:
                self._faults[topic] = f"published as {kind}; subscribed as {wanted}"
                return
            if message._connection_header["md5sum"] != md5:
                self._faults[topic] = f"{kind} of another version than belie reads (other MD5 sum)"
                return
            try:
                data = bytes(STORE.ros1_to_cdr(message._buff, message_type))
            except Exception:  # damaged bytes are told as such by whoever reads them
                data = bytes(message._buff)
            receive(Received(topic=topic, message_type=message_type, data=data, received_ns=received_ns))

        subscriber = self._rospy.Subscriber(
            topic, self._rospy.AnyMsg, handle, queue_size=depth, buff_size=2**24, tcp_nodelay=True
        )
        self._subscribers.append(subscriber)

    def advertise(self, topic: str, message_type: str, *, latched: bool) -> Publisher:
        """Announce a topic; see `Transport`."""
        definition, md5 = self._store.generate_msgdef(message_type, ros_version=1)
        kind = type(
            "Raw",
            (self._rospy.AnyMsg,),
            {"_type": ros1_type(message_type), "_md5sum": md5, "_full_text": definition},
        )
        depth = writer_depth(message_type, latched=latched)
        publisher = self._rospy.Publisher(topic, kind, latch=latched, queue_size=depth, tcp_nodelay=True)
        self._publishers[topic] = publisher
        return _Ros1Publisher(kind, publisher, message_type)

    def subscribers(self, topic: str) -> int:
        """How many listen; see `Transport`."""
        publisher = self._publishers.get(topic)
        return 0 if publisher is None else int(publisher.get_num_connections())

    def lost(self) -> Mapping[str, int]:
        """TCP loses nothing on its way, and the middleware does not tell what it drops itself."""
        return {}

    def faults(self) -> Mapping[str, str]:
        """Types that do not match, by topic; the master, where it does not answer."""
        return dict(self._faults)

    def reset(self) -> None:
        """Drop subscriptions and topics of ours."""
        for one in (*self._subscribers, *self._publishers.values()):
            one.unregister()
        self._subscribers.clear()
        self._publishers.clear()
        self._faults.clear()

    def close(self) -> None:
        """Leave the network."""
        self.reset()
        self._rospy.signal_shutdown("belie stops")
