"""What the robot says of itself: the claims that belie judges.

Every claim carries two times: ``stamp_ns`` is what the sender says (forgeable), ``received_ns`` ours.
Covariances are ordered translation, then rotation. An all-zero covariance means unknown: readers pass None.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from belie.geometry import SE3, FloatArray
from belie.types.arrays import frozen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseClaim:
    """A claimed odometry pose: ``T_odom_body`` at `stamp_ns` (nav_msgs/Odometry.pose).

    Parameters
    ----------
    source : str
        Topic that made the claim.
    frame_id : str
        Name of the frame the pose is expressed in (``header.frame_id``).
    T_odom_body : SE3
        Maps body to odom coordinates.
    covariance : array (6, 6) or None
        Of the pose, m² and rad²; None if unknown.

    Examples
    --------
    >>> PoseClaim(source="/odom", frame_id="odom", stamp_ns=0, received_ns=0,
    ...           T_odom_body=SE3.identity(), covariance=None).source
    '/odom'
    """

    source: str
    frame_id: str
    stamp_ns: int
    received_ns: int
    T_odom_body: SE3
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.covariance is not None:
            object.__setattr__(self, "covariance", frozen(self.covariance, (6, 6), "covariance"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionClaim:
    """A claimed velocity at `stamp_ns`, in body axes: an odometry twist, or an IMU sample.

    Parameters
    ----------
    kind : "twist" or "imu"
        Where it comes from: nav_msgs/Odometry.twist or sensor_msgs/Imu.
    linear_m_s : array (3,) or None
        Velocity of the body's origin; None where not measured (IMU).
    angular_rad_s : array (3,) or None
        Angular rate; None where not measured.
    acceleration_m_s2 : array (3,) or None
        Specific force of an IMU, gravity included.
    covariance : array (6, 6) or None
        Of (linear, angular); None if unknown.
    """

    source: str
    kind: Literal["twist", "imu"]
    stamp_ns: int
    received_ns: int
    linear_m_s: FloatArray | None = None
    angular_rad_s: FloatArray | None = None
    acceleration_m_s2: FloatArray | None = None
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        for name in ("linear_m_s", "angular_rad_s", "acceleration_m_s2"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen(value, (3,), name))
        if self.covariance is not None:
            object.__setattr__(self, "covariance", frozen(self.covariance, (6, 6), "covariance"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionClaim:
    """A claimed position at `stamp_ns`: GNSS (in ENU metres about its first fix) or localisation.

    Parameters
    ----------
    frame_id : str
        Name of the frame the position is expressed in; where it equals the odometry's, both share
        axes, else the yaw between them is unknown and estimated.
    position_m : array (3,)
        Position of the body's origin, or of the point `lever_m` where that is given.
    covariance : array (3, 3) or None
        m²; None if unknown.
    lever_m : array (3,) or None
        Where on the body the position is measured (GNSS antenna), in body axes; None: at its origin.
    """

    source: str
    frame_id: str
    kind: Literal["gnss", "localisation"]
    stamp_ns: int
    received_ns: int
    position_m: FloatArray
    covariance: FloatArray | None = None
    lever_m: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", frozen(self.position_m, (3,), "position_m"))
        if self.lever_m is not None:
            object.__setattr__(self, "lever_m", frozen(self.lever_m, (3,), "lever_m"))
        if self.covariance is not None:
            object.__setattr__(self, "covariance", frozen(self.covariance, (3, 3), "covariance"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detection:
    """One object that a detector claims to see.

    Parameters
    ----------
    label : str
        Its class, in the detector's own words; characters that cannot be printed are escaped, as in `track_id`.
    score : float
        Confidence, 0 to 1.
    track_id : str
        The same for the same object from message to message; empty where the detector does not track.
    box_px : array (4,) or None
        Left, top, right, bottom edge; pixel i covers i to i + 1, so the whole image is (0, 0, width, height).
        None where the detector tells no image box (LiDAR).
    T_cam_obj : SE3 or None
        Maps the object's coordinates (x forward, y left, z up, origin in its middle) to camera ones; None if its
        attitude is not known.
    position_m : array (3,) or None
        Its middle in camera axes (x right, y down, z forward); that of `T_cam_obj` where that is given.
    covariance : array (3, 3) or None
        Of the position, m²; None if unknown.
    dimensions_m : array (3,) or None
        Length, width, height: along the object's x, y and z.

    Examples
    --------
    >>> car = Detection(label="car", score=0.9, track_id="7", T_cam_obj=SE3.from_translation([0, 1, 20.0]))
    >>> car.position_m
    array([ 0.,  1., 20.])
    """

    label: str
    score: float
    track_id: str = ""
    box_px: FloatArray | None = None
    T_cam_obj: SE3 | None = None
    position_m: FloatArray | None = None
    covariance: FloatArray | None = None
    dimensions_m: FloatArray | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.score <= 1.0:
            raise ValueError(f"a score is between 0 and 1, got {self.score}")
        object.__setattr__(self, "label", _printable(self.label))
        object.__setattr__(self, "track_id", _printable(self.track_id))
        if self.T_cam_obj is not None:
            if self.position_m is not None and np.abs(self.T_cam_obj.t - self.position_m).max() > 1e-9:
                raise ValueError("position_m is not that of T_cam_obj")
            object.__setattr__(self, "position_m", self.T_cam_obj.t)
        for name, shape in (
            ("box_px", (4,)),
            ("position_m", (3,)),
            ("covariance", (3, 3)),
            ("dimensions_m", (3,)),
        ):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen(value, shape, name))
        if self.box_px is not None and (self.box_px[2:] < self.box_px[:2]).any():
            raise ValueError(f"box_px is left, top, right, bottom; got {self.box_px.tolist()}")
        if self.covariance is not None and self.position_m is None:
            raise ValueError("a covariance without a position")


def _printable(text: str) -> str:
    """Without control characters: a detector's words go to terminals and logs, which would obey them."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionClaim:
    """All objects that a detector claims to see at `stamp_ns`: one message; none is a claim, too.

    Examples
    --------
    >>> DetectionClaim(source="/detections", stamp_ns=0, received_ns=0, detections=()).detections
    ()
    """

    source: str
    stamp_ns: int
    received_ns: int
    detections: tuple[Detection, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "detections", tuple(self.detections))


Claim = PoseClaim | MotionClaim | PositionClaim | DetectionClaim
