"""An object that is not there: where it stands, how it grows, and how a stream would tell of it."""

from __future__ import annotations

import zlib

import numpy as np

from belie.attacks.axes import vehicle_rotation
from belie.attacks.object_catalogue import BOX
from belie.attacks.plan import Plan
from belie.attacks.timing import NS_PER_S
from belie.geometry import SE3, FloatArray, clipped_box_px, projected_box_px
from belie.types import AttackError, Detection, MountedCamera

_SCORE = 0.9
_NEAREST_M = 4.0
_USUAL_CAMERA_HEIGHT_M = 1.5
_LOWEST_CAMERA_M = 0.5
# Length, width, height.
_SIZES_M = {
    "car": (4.2, 1.8, 1.5),
    "van": (5.0, 2.0, 2.2),
    "truck": (8.0, 2.5, 3.2),
    "bus": (11.0, 2.5, 3.1),
    "pedestrian": (0.6, 0.6, 1.75),
    "person": (0.6, 0.6, 1.75),
    "cyclist": (1.8, 0.6, 1.75),
    "bicycle": (1.8, 0.6, 1.4),
}
_OTHER_SIZE_M = (1.0, 1.0, 1.0)


class Phantom:
    """The phantom of one attack; it tells each stream only what that stream tells of its other objects.

    A camera with a body frame of ROS axes is as high over the road as over that frame's origin; where that is below
    half a metre, or the body is the camera, 1.5 m are taken.

    Raises
    ------
    AttackError
        Where it would stand out of the camera's view.

    Examples
    --------
    >>> from belie.attacks import parse_attack
    >>> from belie.attacks.timing import FrameClock
    >>> from belie.geometry import CameraModel
    >>> model = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> plan = Plan.of(parse_attack("detections-phantom:distance=12.1,motion=approach,speed=4,start=1"),
    ...                FrameClock(np.arange(9)), "rdf", MountedCamera(model=model, T_body_cam=SE3.identity()))
    >>> phantom = Phantom(plan, plan.camera)
    >>> [phantom.seen(t * NS_PER_S, None, "x").box_px.tolist() for t in (0, 1)]
    [[275.0, 240.0, 365.0, 315.0], [245.0, 240.0, 395.0, 365.0]]
    """

    def __init__(self, plan: Plan, camera: MountedCamera) -> None:
        self._plan, self._model = plan, camera.model
        label = str(plan.spec["label"])
        self._size_m = np.array(_SIZES_M.get(label.lower(), _OTHER_SIZE_M))
        vehicle = SE3(camera.T_body_cam.R.T @ vehicle_rotation(plan.body_axes), np.zeros(3))
        self._is_boxed = plan.spec["x"] is not None
        self._box_px, self._T_cam_obj = self._given(vehicle) or self._on_the_road(vehicle, camera)
        self._first_ns: int | None = None

    def seen(self, stamp_ns: int, like: Form | None, track_id: str) -> Detection | None:
        """What is claimed of it at a time, in the form of the stream; None once it has left the view."""
        self._first_ns = stamp_ns if self._first_ns is None else self._first_ns
        form = like or Form()
        T_cam_obj, box_px = self._moved(stamp_ns - self._first_ns)
        if box_px is None:
            return None
        return Detection(
            label=str(self._plan.spec["label"]),
            score=_SCORE,
            track_id=track_id,
            box_px=box_px if form.box else None,
            T_cam_obj=T_cam_obj if form.attitude else None,
            position_m=T_cam_obj.t if form.position or form.attitude else None,
            covariance=form.covariance if form.position or form.attitude else None,
            dimensions_m=self._size_m if form.dimensions else None,
        )

    def _given(self, vehicle: SE3) -> tuple[FloatArray, SE3] | None:
        """Box and pose of the options x, y, w, h: as far as its height makes it."""
        spec = self._plan.spec
        if not self._is_boxed:
            return None
        left, top, width, height = (spec.number(name) for name in BOX)
        box_px = clipped_box_px(np.array([left, top, left + width, top + height]), self._model)
        if box_px is None:
            raise AttackError(f"{spec.to_text()}: the box lies outside the image of {self._image()}")
        middle_px = np.array([[left + 0.5 * width - 0.5, top + 0.5 * height - 0.5]])
        depth_m = self._model.fy * self._size_m[2] / height
        place_m = depth_m * np.append(self._model.normalize(middle_px)[0], 1.0)
        return box_px, SE3(vehicle.R, place_m)

    def _on_the_road(self, vehicle: SE3, camera: MountedCamera) -> tuple[FloatArray, SE3]:
        spec = self._plan.spec
        height_m = float(camera.T_body_cam.t[2]) if self._plan.body_axes == "flu" else 0.0
        height_m = height_m if height_m >= _LOWEST_CAMERA_M else _USUAL_CAMERA_HEIGHT_M
        middle = [spec.number("distance"), -spec.number("right"), 0.5 * self._size_m[2] - height_m]
        T_cam_obj = SE3(vehicle.R, vehicle.R @ np.array(middle))
        box_px = self._projected(T_cam_obj)
        if box_px is None:
            raise AttackError(
                f"{spec.to_text()}: a phantom there is out of the camera's view; set distance and right, or its "
                f"box x, y, w, h in the image of {self._image()}"
            )
        return box_px, T_cam_obj

    def _image(self) -> str:
        return f"{self._model.width}x{self._model.height} px"

    def _moved(self, elapsed_ns: int) -> tuple[SE3, FloatArray | None]:
        """Pose and box after some time: the object comes along the optical axis, its box grows as it does.

        No box once it has passed out of the image.
        """
        T_cam_obj, box_px = self._T_cam_obj, self._box_px
        depth_m = float(T_cam_obj.t[2])
        if self._plan.spec["motion"] == "still" or depth_m <= _NEAREST_M:
            return T_cam_obj, box_px
        nearer_m = max(_NEAREST_M, depth_m - self._plan.spec.number("speed") * elapsed_ns / NS_PER_S)
        nearer = SE3(T_cam_obj.R, np.array([*T_cam_obj.t[:2], nearer_m]))
        return nearer, self._scaled(depth_m / nearer_m) if self._is_boxed else self._projected(nearer)

    def _projected(self, T_cam_obj: SE3) -> FloatArray | None:
        solid = Detection(label="", score=_SCORE, T_cam_obj=T_cam_obj, dimensions_m=self._size_m)
        return projected_box_px(solid, self._model)

    def _scaled(self, factor: float) -> FloatArray | None:
        """The first box as a flat thing is seen that comes nearer along the optical axis."""
        corners = self._model.normalize(self._box_px.reshape(2, 2) - 0.5) * factor
        edges_px = self._model.project(np.column_stack([corners, np.ones(2)])).ravel() + 0.5
        return clipped_box_px(edges_px, self._model)


class Form:
    """What a stream tells of its objects: boxes, positions, attitudes, dimensions, covariances.

    >>> form = Form()
    >>> form.learn(Detection(label="car", score=1.0, position_m=[0, 0, 9.0]))
    >>> form.box, form.position, form.dimensions
    (False, True, False)
    """

    def __init__(self) -> None:
        self.box = True  # until something is seen
        self.position = self.attitude = self.dimensions = False
        self.covariance: FloatArray | None = None
        self._boxes = False

    def learn(self, detection: Detection) -> None:
        """Take in one detection of the stream."""
        self._boxes |= detection.box_px is not None
        self.box = self._boxes
        self.position |= detection.position_m is not None
        self.attitude |= detection.T_cam_obj is not None
        self.dimensions |= detection.dimensions_m is not None
        self.covariance = detection.covariance if self.covariance is None else self.covariance


def new_track_id(plan: Plan, taken: set[str]) -> str:
    """An id for a phantom: the same for the same attack, and none that the stream has named.

    >>> from belie.attacks import parse_attack
    >>> from belie.attacks.timing import FrameClock
    >>> plan = Plan.of(parse_attack("detections-phantom:start=1"), FrameClock(np.arange(9)), "flu")
    >>> first = new_track_id(plan, set())
    >>> 9000 <= int(first) < 10000, new_track_id(plan, {first}) == str(int(first) + 1)
    (True, True)
    """
    number = 9000 + zlib.crc32(plan.spec.to_text().encode()) % 1000
    while str(number) in taken:
        number += 1
    return str(number)
