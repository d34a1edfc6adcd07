"""The tree of fixed frames that /tf_static tells, and the chains through it."""

from __future__ import annotations

from collections import deque
from typing import Any

from belie.geometry import SE3
from belie.types import CalibrationError


def frame_name(name: str) -> str:
    """A frame's name without the leading slash that tf (ROS 1) allowed.

    >>> frame_name("/base_link")
    'base_link'
    """
    return name.strip().lstrip("/")


class TransformTree:
    """Fixed transforms between named frames.

    Examples
    --------
    >>> tree = TransformTree()
    >>> tree.add("base_link", "mast", SE3.from_translation([0.0, 0.0, 1.0]))
    >>> tree.add("mast", "camera", SE3.from_translation([0.1, 0.0, 0.0]))
    >>> tree.require("base_link", "camera").t
    array([0.1, 0. , 1. ])
    >>> tree.find("base_link", "gnss") is None
    True
    """

    def __init__(self) -> None:
        self._neighbours: dict[str, dict[str, SE3]] = {}
        self._parent: dict[str, str] = {}

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted(self._neighbours))

    def add(self, parent: str, child: str, T_parent_child: SE3) -> None:
        """Add an edge; a later one between the same frames replaces it."""
        parent, child = frame_name(parent), frame_name(child)
        self._neighbours.setdefault(parent, {})[child] = T_parent_child
        self._neighbours.setdefault(child, {})[parent] = T_parent_child.inverse()
        self._parent[child] = parent

    def add_message(self, message: Any) -> None:
        """Add the edges of a ``tf2_msgs/TFMessage``.

        Raises
        ------
        CalibrationError
            If one of them is not a rigid motion.
        """
        for edge in message.transforms:
            q, t = edge.transform.rotation, edge.transform.translation
            try:
                T_parent_child = SE3.from_quat_xyzw([q.x, q.y, q.z, q.w], [t.x, t.y, t.z])
            except ValueError as error:
                raise CalibrationError(
                    f"/tf_static: the transform {edge.header.frame_id} to {edge.child_frame_id} "
                    f"cannot be used: {error}"
                ) from error
            self.add(edge.header.frame_id, edge.child_frame_id, T_parent_child)

    def root(self, frame: str) -> str:
        """The topmost frame above `frame`."""
        frame, seen = frame_name(frame), set[str]()
        while frame in self._parent and frame not in seen:
            seen.add(frame)
            frame = self._parent[frame]
        return frame

    def find(self, target: str, source: str) -> SE3 | None:
        """``T_target_source``, or None if no chain joins them; a frame to itself is the identity."""
        target, source = frame_name(target), frame_name(source)
        if target == source:
            return SE3.identity()
        reached = {target: SE3.identity()}
        queue = deque([target])
        while queue:
            frame = queue.popleft()
            for neighbour, T_frame_neighbour in self._neighbours.get(frame, {}).items():
                if neighbour not in reached:
                    reached[neighbour] = reached[frame] @ T_frame_neighbour
                    queue.append(neighbour)
        return reached.get(source)

    def require(self, target: str, source: str, *, instead: str = "") -> SE3:
        """``T_target_source``; `instead` names another way out for the error's text.

        Raises
        ------
        CalibrationError
            If no chain of fixed transforms joins the two frames; names the missing transform.
        """
        T_target_source = self.find(target, source)
        if T_target_source is None:
            known = ", ".join(self.frames) or "none"
            named = frame_name(source) or "an unnamed frame (the messages' frame_id is empty)"
            raise CalibrationError(
                f"no transform from {frame_name(target)} to {named} on /tf_static "
                f"(frames there: {known}); record /tf_static, or publish it with "
                f"static_transform_publisher and record again{instead}"
            )
        return T_target_source
