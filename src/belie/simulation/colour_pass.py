"""The picture as light falls through a pinhole: shadows, what the wet road mirrors, surfaces, sky, lamps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray
from belie.simulation.glows import glow_sprites
from belie.simulation.light import light_uniforms
from belie.simulation.noise_maps import NoiseMaps
from belie.simulation.paint import Paint
from belie.simulation.placed import Placed
from belie.simulation.programs import UNITS, Programs, has_mirror, has_sun, set_all
from belie.simulation.projection import (
    frustum_planes,
    mirrored,
    picture_rays,
    projection_matrix,
    sight_m,
    sun_direction,
)
from belie.simulation.shadows import ShadowMaps
from belie.simulation.stock import Stock
from belie.simulation.weather import Weather
from belie.simulation.world import World

if TYPE_CHECKING:
    import moderngl

_SAMPLES = 4  # without them edges sparkle, and corners are found that are none
_SAMPLE_ALPHA_TO_COVERAGE = 0x809E
_MIRROR_SHARE = 3  # a wet road smears what it mirrors: a third of the resolution does
_MIRROR_REACH_M = 90.0


class ColourPass:
    """Draws a world in colour; made and owned by `Renderer`."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: Programs,
        stock: Stock,
        world: World,
        camera: CameraModel,
        weather: Weather,
    ) -> None:
        self._context, self._programs, self._stock = context, programs, stock
        self._world, self._camera, self._weather = world, camera, weather
        self._projection = projection_matrix(camera, world.near_m)
        self._reach_m = sight_m(weather)
        self._sun = sun_direction(weather, world.street_direction_rad)
        self._shadows = ShadowMaps(
            context, self._sun if has_sun(world, weather) else None, world.shadow_reach_m
        )
        self._noise = NoiseMaps(context, world)
        self._sky_array = context.vertex_array(programs["sky"], [])
        size = (camera.width, camera.height)
        self._sharp = context.framebuffer(
            [context.renderbuffer(size, 4, samples=_SAMPLES)],
            context.depth_renderbuffer(size, samples=_SAMPLES),
        )
        self._plain = context.simple_framebuffer(size, 4)
        self._mirrors = has_mirror(world, weather)
        small = (
            (max(1, size[0] // _MIRROR_SHARE), max(1, size[1] // _MIRROR_SHARE)) if self._mirrors else (1, 1)
        )
        self._mirror_texture = context.texture(small, 4)
        self._mirror_texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
        self._mirror_texture.repeat_x = self._mirror_texture.repeat_y = False
        self._mirror = context.framebuffer([self._mirror_texture], context.depth_renderbuffer(small))

    def draw(self, placed: list[Placed], T_world_cam: SE3) -> npt.NDArray[np.uint8]:
        """The picture, shape (H, W, 4), RGBA, gamma 2."""
        context = self._context
        context.enable_only(context.DEPTH_TEST)
        self._shadows.cast(self._programs, self._stock, placed, T_world_cam)
        self._shadows.bind()
        self._noise.bind()
        self._mirror_texture.use(UNITS["mirror"])
        if self._mirrors:
            self._view(self._mirror, placed, T_world_cam, is_mirror=True)
            self._mirror_texture.build_mipmaps()
            self._mirror_texture.use(UNITS["mirror"])
        self._view(self._sharp, placed, T_world_cam, is_mirror=False)
        context.copy_framebuffer(self._plain, self._sharp)
        size = (self._camera.height, self._camera.width, 4)
        return np.frombuffer(self._plain.read(components=4), np.uint8).reshape(size)

    def _view(
        self, target: moderngl.Framebuffer, placed: list[Placed], T_world_cam: SE3, *, is_mirror: bool
    ) -> None:
        flip = np.array([1.0, 1.0, -1.0 if is_mirror else 1.0])
        view = T_world_cam.inverse().matrix()
        view = mirrored(view) if is_mirror else view
        eye, R_world_cam = flip * T_world_cam.t, flip[:, None] * T_world_cam.R
        reach_m = min(self._reach_m, _MIRROR_REACH_M) if is_mirror else self._reach_m
        planes = frustum_planes(self._projection @ view, reach_m, eye, R_world_cam[:, 2])
        bodies = [body for body in placed if body.is_within(planes)]
        common = {
            **light_uniforms(self._world, self._weather, self._sun, T_world_cam),
            "sun_projection": self._shadows.projection,
            "lamp_area": self._noise.lamp_area,
            "eye": tuple(eye),
            "view_projection": self._projection @ view,
            "size": tuple(float(v) for v in target.size),
        }
        # The first row of the buffer is the top of the picture, which turns triangles round; a mirror turns them back.
        self._context.front_face = "ccw" if is_mirror else "cw"
        target.use()
        target.clear(depth=1.0)
        paint = Paint(self._programs, self._world, self._weather, common, is_mirrored=is_mirror)
        self._opaque(paint, planes, bodies, eye)
        self._sky(R_world_cam, common)
        self._decals(target, paint, planes, bodies)
        self._cutouts(paint, planes, bodies, covers=not is_mirror)
        self._glows(target, view, placed, eye)

    def _opaque(self, paint: Paint, planes: FloatArray, bodies: list[Placed], eye: FloatArray) -> None:
        """Solid surfaces, from near to far.

        To draw all depths first, so that each pixel is lit but once, costs more on llvmpipe than it saves.
        """
        self._context.enable(self._context.CULL_FACE)
        self._bodies("opaque", paint, bodies)
        for mesh, runs in self._stock.nearest_first("opaque", planes, eye):
            self._stock.draw_runs(mesh, paint.standing(mesh.material), runs)
        self._context.disable(self._context.CULL_FACE)

    def _decals(
        self, target: moderngl.Framebuffer, paint: Paint, planes: FloatArray, bodies: list[Placed]
    ) -> None:
        context = self._context
        context.enable(context.BLEND)
        context.blend_func = context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA
        target.depth_mask = False
        self._surfaces("decal", paint, planes, bodies)
        target.depth_mask = True
        context.disable(context.BLEND)

    def _cutouts(self, paint: Paint, planes: FloatArray, bodies: list[Placed], *, covers: bool) -> None:
        """Leaves and signs; `covers` smooths their edges by the samples that they cover."""
        if covers:
            self._context.enable_direct(_SAMPLE_ALPHA_TO_COVERAGE)
        self._surfaces("cutout", paint, planes, bodies)
        self._context.disable_direct(_SAMPLE_ALPHA_TO_COVERAGE)

    def _surfaces(self, kind: str, paint: Paint, planes: FloatArray, bodies: list[Placed]) -> None:
        self._bodies(kind, paint, bodies)
        for mesh in self._stock.still(kind):
            self._stock.draw(mesh, paint.standing(mesh.material), planes)

    def _bodies(self, kind: str, paint: Paint, bodies: list[Placed]) -> None:
        for body in bodies:
            for part, model, _ in body.parts:
                for mesh in self._stock.of_part(part, kind):
                    self._stock.draw(mesh, paint.moving(mesh.material, model), None)

    def _sky(self, R_world_cam: FloatArray, common: dict[str, object]) -> None:
        rays = picture_rays(self._camera, R_world_cam)
        set_all(self._programs["sky"], {**common, "rays": rays, "cloud_share": self._weather.clouds})
        self._context.depth_func = "<="
        self._sky_array.render(vertices=3)
        self._context.depth_func = "<"

    def _glows(
        self, target: moderngl.Framebuffer, view: FloatArray, placed: list[Placed], eye: FloatArray
    ) -> None:
        context, program = self._context, self._programs["glow"]
        sprites = glow_sprites(self._world, placed, self._weather, eye)
        if len(sprites) == 0:
            return
        set_all(program, {"view": view, "projection": self._projection})
        buffer = context.buffer(sprites.astype(np.float32).tobytes())
        array = context.vertex_array(program, [(buffer, "3f 3f 1f/i", "in_centre", "in_light", "in_radius")])
        context.enable(context.BLEND)
        context.blend_func = context.ONE, context.ONE
        target.depth_mask = False
        array.render(context.TRIANGLE_STRIP, vertices=4, instances=len(sprites))
        target.depth_mask = True
        context.disable(context.BLEND)
        array.release()
        buffer.release()
