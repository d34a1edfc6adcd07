import numpy as np
import pytest
from render_tools import camera, needs_egl, world

from belie.simulation.imaging import ImagingSettings
from belie.simulation.labels import object_labels
from belie.simulation.renderer import Renderer
from belie.simulation.weather import WEATHERS

_CLEAN = ImagingSettings(motion_blur=False, noise_scale=0.0)


def _labelled(scene, t_s, manoeuvre="straight"):
    model, seen = camera(640, 480), world(scene, manoeuvre)
    with Renderer(seen, model, WEATHERS["sunny"], 1, _CLEAN) as renderer:
        rendered = renderer.render(t_s)
    return rendered, object_labels(seen, rendered, model, t_s, seen.ego.T_world_body(t_s))


@pytest.mark.slow
@needs_egl
@pytest.mark.parametrize("scene", ["street", "patch", "corridor"])
def test_boxes_match_the_ids(scene):
    rendered, labels = _labelled(scene, 0.6)
    assert labels
    for label in labels:
        y, x = np.nonzero(rendered.ids == label.id)
        seen = np.array([x.min(), y.min(), x.max() + 1, y.max() + 1])
        # The seen part lies within the box; it is the box where nothing hides it.
        assert (seen[:2] >= label.box_px[:2] - 1.0).all()
        assert (seen[2:] <= label.box_px[2:] + 1.0).all()
        if label.visible > 0.97 and label.truncation == 0.0:
            assert np.abs(seen - label.box_px).max() < 2.0


@pytest.mark.slow
@needs_egl
def test_depth_at_an_object_is_its_distance():
    rendered, labels = _labelled("street", 0.6)
    checked = 0
    for label in labels:
        if label.visible < 0.6:
            continue
        depth = rendered.depth_m[rendered.ids == label.id]
        reach = 0.5 * np.linalg.norm(label.dimensions_m)
        assert abs(np.median(depth) - label.T_cam_obj.t[2]) < reach + 0.2
        checked += 1
    assert checked >= 3


@needs_egl
def test_visible_share_and_truncation():
    _, labels = _labelled("street", 0.6)
    assert all(0.0 < label.visible <= 1.0 and 0.0 <= label.truncation < 1.0 for label in labels)
    assert any(label.visible < 0.8 for label in labels)  # parked vehicles hide each other
    assert any(label.visible > 0.95 for label in labels)


@needs_egl
def test_labels_need_ids():
    model, seen = camera(), world("patch")
    with Renderer(seen, model, WEATHERS["sunny"], 1) as renderer:
        rendered = renderer.render(0.0, with_truth=False)
    with pytest.raises(ValueError, match="with ids"):
        object_labels(seen, rendered, model, 0.0, seen.ego.T_world_body(0.0))


def test_patched_actors_say_so():
    assert {actor.label for actor in world("patch").actors if actor.is_patched} == {"stop sign", "door"}


def test_shapes_fit_their_boxes():
    """No vertex of an actor stands farther out of its stated box than mirrors and swinging arms do."""
    for actor in (*world("street").actors, *world("patch").actors):
        own = [mesh for part in actor.parts if not part.is_mount for mesh in part.meshes]
        solid = [mesh for mesh in own if not mesh.material.is_decal]
        points = np.concatenate([mesh.points for mesh in solid])
        half = 0.5 * np.array(actor.dimensions_m[:2])
        assert (np.abs(points[:, :2]) <= half + 0.35).all(), actor.label
        assert points[:, 2].max() <= actor.base_m + actor.dimensions_m[2] + 0.12, actor.label
        assert points[:, 2].min() >= actor.base_m - 0.05


@needs_egl
def test_a_sign_is_labelled_without_its_post():
    """As data sets box it: its label is the plate, and the pixels of its post are nobody's."""
    model, seen = camera(), world("patch")
    with Renderer(seen, model, WEATHERS["sunny"], 1) as renderer:
        rendered = renderer.render(0.0)
    T_world_body = seen.ego.T_world_body(0.0)
    (sign,) = (
        label
        for label in object_labels(seen, rendered, model, 0.0, T_world_body)
        if label.label == "stop sign"
    )
    width, height = sign.box_px[2] - sign.box_px[0], sign.box_px[3] - sign.box_px[1]
    assert height == pytest.approx(width, rel=0.25)
    rows = np.nonzero(rendered.ids == sign.id)[0]
    assert rows.max() <= sign.box_px[3]
    assert 0.75 < sign.visible < 0.87  # of the square that its picture is cut from: an octagon covers 0.83


def test_nothing_stands_in_the_way_of_the_robot():
    """No parked vehicle, sign or wall is where the robot drives."""
    for scene, clear_m in (("street", 0.9), ("patch", 0.35), ("corridor", 0.2)):
        seen = world(scene)
        track = np.array([seen.ego.T_world_body(t).t[:2] for t in np.arange(0.0, 3.0, 0.1)])
        for mesh in seen.static:
            tall = mesh.points[(mesh.points[:, 2] > 0.2) & (mesh.points[:, 2] < 1.5)][:, :2]
            if len(tall):
                nearest = np.linalg.norm(tall[:, None] - track[None, ::5], axis=2).min()
                assert nearest > clear_m, scene
