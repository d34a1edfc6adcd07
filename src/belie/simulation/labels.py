"""Exact labels: where each actor is in the picture, how much of it is seen, and where it is in space."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray
from belie.simulation.rendered import Rendered
from belie.simulation.world import Actor, World
from belie.types import frozen

_LEAST_PIXELS = 6
_NEAR_M = 0.2
_FARTHEST_M = 250.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObjectLabel:
    """One actor in one picture.

    Parameters
    ----------
    id, label : int, str
        Of the actor.
    box_px : array (4,)
        Left, top, right, bottom edge of its shape, whether hidden or not, cut at the image's border. Pixel centres are
        integers and edges are counted from the image's corner: the leftmost pixel spans 0 to 1.
    visible : float
        Share of the shape within the image that nothing hides, 0 to 1.
    truncation : float
        Share of its box that lies outside of the image.
    distance_m : float
        From the camera to the middle of the box.
    T_cam_obj : SE3
        Pose of the middle of the box; x forward, z up of the object.
    dimensions_m : tuple of float
        Length, width, height.
    """

    id: int
    label: str
    box_px: FloatArray
    visible: float
    truncation: float
    distance_m: float
    T_cam_obj: SE3
    dimensions_m: tuple[float, float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "box_px", frozen(self.box_px, (4,), "box_px"))


def object_labels(
    world: World, rendered: Rendered, camera: CameraModel, t_s: float, T_world_body: SE3
) -> tuple[ObjectLabel, ...]:
    """Labels of all actors of which at least a few pixels are seen.

    Parameters
    ----------
    world : World
        Whose actors.
    rendered : Rendered
        With ids.
    camera : CameraModel
        That took it.
    t_s : float
        When.
    T_world_body : SE3
        From where.

    Raises
    ------
    ValueError
        If `rendered` has no ids.
    """
    if rendered.ids is None:
        raise ValueError("labels need a picture that was rendered with ids")
    T_cam_world = (T_world_body @ world.T_body_cam).inverse()
    seen = _seen_pixels(rendered)
    labels = []
    for actor in world.actors:
        if seen.get(actor.id, 0) < _LEAST_PIXELS:
            continue
        T_cam_obj = T_cam_world @ actor.T_world_box(t_s)
        distance_m = float(np.linalg.norm(T_cam_obj.t))
        if distance_m > _FARTHEST_M:
            continue
        label = _label(actor, seen[actor.id], camera, T_cam_world, t_s, T_cam_obj, distance_m)
        if label is not None:
            labels.append(label)
    return tuple(labels)


def _seen_pixels(rendered: Rendered) -> dict[int, int]:
    assert rendered.ids is not None
    values, counts = np.unique(rendered.ids[rendered.ids > 0], return_counts=True)
    return dict(zip(values.tolist(), counts.tolist(), strict=True))


def _label(
    actor: Actor,
    seen_px: int,
    camera: CameraModel,
    T_cam_world: SE3,
    t_s: float,
    T_cam_obj: SE3,
    distance_m: float,
) -> ObjectLabel | None:
    shape = actor_silhouette(actor, camera, T_cam_world @ actor.motion.T_world_body(t_s), t_s)
    if shape is None:
        return None
    triangles_px, box = shape
    clipped = np.clip(box, 0.0, np.tile([camera.width, camera.height], 2).astype(np.float64))
    area = float(np.prod(box[2:] - box[:2]))
    inside = float(np.prod(clipped[2:] - clipped[:2]))
    if inside <= 0.0:
        return None
    return ObjectLabel(
        id=actor.id,
        label=actor.label,
        box_px=clipped,
        visible=min(1.0, seen_px / max(_covered_pixels(triangles_px, clipped), 1.0)),
        truncation=1.0 - inside / area,
        distance_m=distance_m,
        T_cam_obj=T_cam_obj,
        dimensions_m=actor.dimensions_m,
    )


def actor_silhouette(
    actor: Actor, camera: CameraModel, T_cam_obj: SE3, t_s: float
) -> tuple[FloatArray, FloatArray] | None:
    """What an actor shows of its triangles, shape (M, 3, 2), px, and the edges around all of them, shape (4,).

    Triangles that reach behind the camera are left out; None if nothing is left. Backs are not shown.
    Edges are counted from the image's corner, triangles from the middle of the first pixel.
    """
    from belie.simulation.articulation import part_pose

    seen, shape = [], []
    for part in actor.parts:
        T_obj_part = part_pose(part, actor.motion.travelled_m(t_s), t_s)
        if T_obj_part is None or part.is_mount:
            continue
        T = T_cam_obj.matrix() @ T_obj_part
        for mesh in part.meshes:
            if mesh.material.is_decal:  # its darkness on the ground is none of it
                continue
            points = mesh.points @ T[:3, :3].T + T[:3, 3]
            corners = points[mesh.triangles]
            corners = corners[(corners[:, :, 2] > _NEAR_M).all(axis=1)]
            flat_px = camera.project(corners.reshape(-1, 3)).reshape(-1, 3, 2)
            shape.append(flat_px.reshape(-1, 2))
            seen.append(flat_px if mesh.material.is_cutout else flat_px[_faces_camera(flat_px)])
    flat = np.concatenate(shape) if shape else np.zeros((0, 2))
    if len(flat) == 0:
        return None
    return np.concatenate(seen), np.concatenate([flat.min(axis=0), flat.max(axis=0)]) + 0.5


def _faces_camera(triangles_px: FloatArray) -> npt.NDArray[np.bool_]:
    """Which triangles show their front: the renderer draws no other, and they cover as much."""
    a, b = triangles_px[:, 1] - triangles_px[:, 0], triangles_px[:, 2] - triangles_px[:, 0]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0.0)


def _covered_pixels(triangles_px: FloatArray, box: FloatArray) -> float:
    """Pixels that the triangles cover within a box: drawn at up to 256 px a side and scaled."""
    x0, y0, x1, y1 = box
    scale = min(1.0, 256.0 / max(x1 - x0, y1 - y0, 1.0))
    # Small shapes are drawn larger, so that pixels at the edge count by their share.
    scale = max(scale, min(8.0, 48.0 / max(x1 - x0, y1 - y0, 1.0)))
    mask = np.zeros((max(1, round((y1 - y0) * scale)), max(1, round((x1 - x0) * scale))), np.uint8)
    sub = 16.0  # OpenCV's fixed point: fillPoly with shift 4
    corners = ((triangles_px + 0.5 - [x0, y0]) * scale - 0.5) * sub
    for triangle in np.clip(corners, -3.0e5, 3.0e5).round().astype(np.int32):
        cv2.fillConvexPoly(mask, triangle, 1, cv2.LINE_8, 4)
    return float(mask.sum()) / float(scale * scale)
