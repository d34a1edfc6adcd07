"""Pictures agree with the truth that comes along: the same pixels by seed, depth with poses, tracks with geometry."""

import builtins
from itertools import pairwise

import cv2
import numpy as np
import pytest
from render_tools import T_world_cam, camera, needs_egl, points_of, world

from belie.simulation.imaging import ImagingSettings
from belie.simulation.motion import Parked
from belie.simulation.renderer import Renderer
from belie.simulation.weather import WEATHERS
from belie.types import BelieError, MissingExtraError

_CLEAN = ImagingSettings(motion_blur=False, noise_scale=0.0)
_SCENES = ("street", "corridor", "flight", "patch")


def _render(scene, weather, times, seed=1, model=None, settings=None, manoeuvre="straight"):
    with Renderer(world(scene, manoeuvre), model or camera(), WEATHERS[weather], seed, settings) as renderer:
        return [renderer.render(t) for t in times]


@needs_egl
def test_same_seed_same_pixels_whatever_came_before():
    first = _render("street", "rainy-night", (0.0, 0.5, 1.0))
    again = _render("street", "rainy-night", (1.0,))
    assert np.array_equal(first[2].bgr, again[0].bgr)
    assert np.array_equal(first[2].ids, again[0].ids)
    assert np.array_equal(first[2].depth_m, again[0].depth_m)
    other = _render("street", "rainy-night", (1.0,), seed=2)
    assert not np.array_equal(first[2].bgr, other[0].bgr)


@pytest.mark.slow
@needs_egl
@pytest.mark.parametrize("scene", _SCENES)
def test_every_weather_renders(scene):
    for name in WEATHERS:
        (rendered,) = _render(scene, name, (0.4,), model=camera(96, 64))
        assert rendered.bgr.shape == (64, 96, 3)
        assert rendered.gray.std() > 2.0, name


@pytest.mark.slow
@needs_egl
@pytest.mark.parametrize("scene", _SCENES)
def test_depth_and_pose_reproduce_the_next_image(scene):
    model = camera()
    seen = world(scene)
    one, two = _render(scene, "sunny", (0.4, 0.5), settings=_CLEAN)
    still = (one.ids == 0) & np.isfinite(one.depth_m)
    pixels = np.column_stack(np.nonzero(still)[::-1])[::3]
    points = points_of(one, model, pixels)
    moved = (T_world_cam(seen, 0.5).inverse() @ T_world_cam(seen, 0.4)).apply(points)
    ahead = moved[:, 2] > 0.1
    place = model.project(moved[ahead]).astype(np.float32)
    inside = (place > 3).all(axis=1) & (place < [model.width - 4, model.height - 4]).all(axis=1)
    place, pixels, z = place[inside], pixels[ahead][inside], moved[ahead][inside, 2]
    sampled = cv2.remap(two.gray, place[None], None, cv2.INTER_LINEAR)[0].astype(float)
    depth = cv2.remap(two.depth_m, place[None], None, cv2.INTER_NEAREST)[0]
    visible = np.abs(depth - z) < 0.03 * z
    assert visible.mean() > 0.9
    before = one.gray[pixels[:, 1], pixels[:, 0]].astype(float)
    error = np.abs(sampled - before)[visible]
    unmoved = np.abs(two.gray[pixels[:, 1], pixels[:, 0]].astype(float) - before)[visible]
    assert np.mean(error) < 0.6 * np.mean(unmoved)
    assert np.median(error) <= 3.0


@pytest.mark.slow
@needs_egl
@pytest.mark.parametrize("scene", _SCENES)
def test_tracks_triangulated_with_true_poses_reproject(scene):
    model, seen = camera(640, 480), world(scene)
    times = (0.3, 0.4, 0.5)
    views = _render(scene, "sunny", times, model=model)
    errors = reprojection_errors(views, [T_world_cam(seen, t) for t in times], model)
    assert len(errors) > 40
    assert np.median(errors) < 0.3


def reprojection_errors(views, poses, model):
    """Corners of the first view tracked to the last, triangulated, and reprojected into the middle one (px)."""
    corners = cv2.goodFeaturesToTrack(views[0].gray, 600, 0.01, 7)
    tracks, good = [corners], np.ones(len(corners), bool)
    for a, b in pairwise(views):
        forth, ok, _ = cv2.calcOpticalFlowPyrLK(a.gray, b.gray, tracks[-1], None, winSize=(15, 15))
        back, _, _ = cv2.calcOpticalFlowPyrLK(b.gray, a.gray, forth, None, winSize=(15, 15))
        good &= (ok.ravel() == 1) & (np.linalg.norm((back - tracks[-1]).reshape(-1, 2), axis=1) < 0.3)
        tracks.append(forth)
    px = [track.reshape(-1, 2).astype(float) for track in tracks]
    for view, at in zip(views, px, strict=True):
        x, y = np.clip(at.round().astype(int), 0, [model.width - 1, model.height - 1]).T
        good &= (view.ids[y, x] == 0) & np.isfinite(view.depth_m[y, x])
    first, last = poses[0], poses[-1]
    T_last_first = last.inverse() @ first
    rays = [np.column_stack([model.normalize(at), np.ones(len(at))]) for at in (px[0], px[-1])]
    depth = _midpoint_depth(rays[0], rays[1], T_last_first)
    parallax = np.linalg.norm(px[-1] - model.project((T_last_first.R @ rays[0].T).T), axis=1)
    good &= (depth > 0.2) & (parallax > 1.0)
    middle = (poses[1].inverse() @ first).apply(rays[0] * depth[:, None])
    return np.linalg.norm(model.project(middle[good]) - px[1][good], axis=1)


def _midpoint_depth(rays_a, rays_b, T_b_a):
    """Depth along rays of a where they come nearest to rays of b."""
    d = (T_b_a.R @ rays_a.T).T
    aa, bb, ab = (d * d).sum(1), (rays_b * rays_b).sum(1), (d * rays_b).sum(1)
    at, bt = d @ T_b_a.t, rays_b @ T_b_a.t
    return (ab * bt - bb * at) / np.maximum(aa * bb - ab * ab, 1e-12)


@pytest.mark.slow
@needs_egl
def test_a_lens_bends_the_picture_as_the_camera_model_says():
    lens = camera(model="radial_tangential", distortion=(-0.2, 0.05, 0.001, -0.001))
    (bent,) = _render("street", "sunny", (0.4,), model=lens, settings=_CLEAN)
    (flat,) = _render("street", "sunny", (0.4,), settings=_CLEAN)
    pixels = np.array([[x, y] for x in range(40, 281, 24) for y in range(30, 211, 20)])
    points = points_of(bent, lens, pixels)
    finite = np.isfinite(points).all(axis=1)
    place = camera().project(points[finite])
    inside = (place > 1).all(axis=1) & (place < [318, 238]).all(axis=1)
    x, y = place[inside].round().astype(int).T
    ratio = flat.depth_m[y, x] / points[finite][inside, 2]
    assert np.mean(np.abs(ratio - 1.0) < 0.05) > 0.85


@pytest.mark.slow
@needs_egl
def test_rolling_shutter_shifts_rows_by_their_time():
    """A row that is exposed later shows the world as it is then."""
    model, readout_s = camera(), 0.02
    rolling = ImagingSettings(rolling_shutter=True, readout_ms=20.0, motion_blur=False, noise_scale=0.0)
    (rolled,) = _render("street", "sunny", (0.4,), model=model, settings=rolling, manoeuvre="highway")
    bottom = 0.4 + readout_s * ((220 + 0.5) / model.height - 0.5)
    early, then = _render("street", "sunny", (0.4, bottom), model=model, settings=_CLEAN, manoeuvre="highway")
    rows = slice(218, 223)
    assert (
        np.abs(rolled.gray[rows].astype(int) - then.gray[rows]).mean()
        < np.abs(rolled.gray[rows].astype(int) - early.gray[rows]).mean()
    )


@pytest.mark.slow
@needs_egl
def test_another_pose_may_be_asked_for():
    seen = world("street")
    with Renderer(seen, camera(), WEATHERS["sunny"], 1, _CLEAN) as renderer:
        own, other = renderer.render(0.5), renderer.render(0.5, Parked(T=seen.ego.T_world_body(0.0)))
        same = renderer.render(0.5, seen.ego)
        lean = renderer.render(0.5, with_truth=False)
    assert np.array_equal(own.bgr, same.bgr)
    assert not np.array_equal(own.bgr, other.bgr)
    assert lean.depth_m is None
    assert np.array_equal(lean.bgr, own.bgr)


@needs_egl
def test_blur_follows_the_motion_that_is_driven():
    """A robot that stands is sharp where the world would have it drive; one that turns smears."""
    seen, night = world("street"), WEATHERS["night"]
    here = seen.ego.T_world_body(0.5)

    class Turning(Parked):
        def twist(self, t_s):
            return np.zeros(3), np.array([0.0, 0.0, 1.0])

    with Renderer(seen, camera(), night, 1, ImagingSettings(noise_scale=0.0)) as renderer:
        stands, turns, drives = (
            cv2.Laplacian(renderer.render(0.5, ego).gray, cv2.CV_64F).var()
            for ego in (Parked(T=here), Turning(T=here), seen.ego)
        )
    assert turns < 0.8 * stands
    assert drives < stands


def test_missing_moderngl_is_one_clear_line(monkeypatch):
    real = builtins.__import__

    def without(name, *more, **named):
        if name == "moderngl":
            raise ImportError(name)
        return real(name, *more, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"pip install 'belie\[sim\]'"):
        Renderer(world("corridor"), camera(), WEATHERS["sunny"], 1)


def test_missing_egl_is_one_clear_line(monkeypatch):
    moderngl = pytest.importorskip("moderngl")

    def broken(*_, **__):
        raise Exception("libEGL.so.1 not found")

    monkeypatch.setattr(moderngl, "create_context", broken)
    with pytest.raises(BelieError, match="apt install libegl1 libgl1") as caught:
        Renderer(world("corridor"), camera(), WEATHERS["sunny"], 1)
    assert "\n" not in str(caught.value)
