"""The passes of one picture: shadows, what the wet road mirrors, colour, lamps; and the truth behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray
from belie.simulation import shaders
from belie.simulation.glows import glow_sprites
from belie.simulation.gpu import GpuMesh, texture_of, upload
from belie.simulation.lamp_map import lamp_map
from belie.simulation.placed import Placed, placed_actors
from belie.simulation.projection import (
    FAR_M,
    frustum_planes,
    mirrored,
    projection_matrix,
    sun_direction,
    sun_projection,
)
from belie.simulation.still import still_meshes
from belie.simulation.textures.noise import fbm
from belie.simulation.weather import Weather
from belie.simulation.world import Material, Part, World

if TYPE_CHECKING:
    import moderngl

_SAMPLES = 4
_SHADOW_TEXELS = 2048
_SHADOW_STEP_M = 16.0  # the map of what never moves is drawn anew after this way
_SAMPLE_ALPHA_TO_COVERAGE = 0x809E
_UNITS = {"image": 0, "detail": 1, "still_shadow": 2, "moving_shadow": 3, "lamp_map": 4, "mirror": 5, "clouds": 6}
_IDENTITY = np.eye(4)
_STILL = np.zeros((4, 4))


class Passes:
    """Draws a world for one camera in one weather; made and owned by `Renderer`."""

    def __init__(self, context: moderngl.Context, world: World, camera: CameraModel, weather: Weather) -> None:
        self._context, self._world, self._camera, self._weather = context, world, camera, weather
        self._near_m = 0.05 if world.is_indoors else 0.2
        self._projection = projection_matrix(camera, self._near_m)
        self._sun = sun_direction(weather, world.street_direction_rad)
        self._has_sun = max(weather.sun) > 0.0 and not world.is_indoors
        self._mirrors = weather.wetness > 0.0 and world.has_flat_ground and not world.is_indoors
        self._textures: dict[Material, moderngl.Texture] = {}
        self._still = [upload(context, mesh, ids, chunked=True) for mesh, ids in still_meshes(world)]
        self._moving: dict[int, list[GpuMesh]] = {}
        self._shadow_middle: tuple[float, ...] | None = None
        self._sun_projection = _IDENTITY
        self._make_programs()
        self._make_targets()
        self._make_maps()

    def _make_programs(self) -> None:
        w, world = self._weather, self._world
        defines = {"NIGHT_GLOW": "1.3" if w.is_dark else ("0.12" if w.clouds >= 1.0 else "0.0")}
        if self._has_sun:
            defines["SUN"] = ""
        if (w.is_dark or world.is_indoors) and len(world.lamps):
            defines["LAMPS"] = ""
            # Outdoors a lamp lights what is below its head; indoors the whole height of the walls.
            defines["LAMP_FALLOFF"] = "1.0" if world.is_indoors else "smoothstep(9.0, 2.0, v_world.z)"
        if w.is_dark and world.headlights_m is not None:
            defines["HEADLIGHTS"] = ""
        if w.wetness > 0.0 and not world.is_indoors:
            defines |= {"WET": "", "WET_GROUND": "1.0" if world.has_flat_ground else "0.4"}
        kinds: dict[str, dict[str, str]] = {"opaque": {}, "cutout": {"CUTOUT": ""}, "decal": {"DECAL": ""}}
        context = self._context
        self._programs = {}
        for kind, own in kinds.items():
            for name, more in ((kind, {"MIRROR": ""} if self._mirrors else {}), (f"{kind} mirrored", {"MIRRORED": ""})):
                if "mirrored" in name and not self._mirrors:
                    continue
                source = shaders.with_defines(shaders.FRAGMENT, {**defines, **own, **more})
                self._programs[name] = self._program(shaders.VERTEX, source)
        for kind in ("opaque", "cutout"):
            self._programs[f"shadow {kind}"] = self._program(
                shaders.SHADOW_VERTEX, shaders.with_defines(shaders.SHADOW_FRAGMENT, kinds[kind])
            )
            self._programs[f"truth {kind}"] = self._program(
                shaders.TRUTH_VERTEX, shaders.with_defines(shaders.TRUTH_FRAGMENT, kinds[kind])
            )
        for name, own in (("depth", {}), ("depth mirrored", {"MIRRORED": ""})):
            fragment = shaders.with_defines(shaders.DEPTH_FRAGMENT, own)
            self._programs[name] = self._program(shaders.DEPTH_VERTEX, fragment)
        self._programs["sky"] = self._program(shaders.FULL_SCREEN, shaders.SKY)
        self._programs["far"] = self._program(shaders.FULL_SCREEN, shaders.FAR_TRUTH)
        self._programs["glow"] = self._program(shaders.GLOW_VERTEX, shaders.GLOW_FRAGMENT)
        self._empty = {name: context.vertex_array(self._programs[name], []) for name in ("sky", "far")}

    def _program(self, vertex: str, fragment: str) -> moderngl.Program:
        program = self._context.program(vertex_shader=vertex, fragment_shader=fragment)
        for name, unit in _UNITS.items():
            _set(program, name, unit)
        return program

    def _make_targets(self) -> None:
        context, size = self._context, (self._camera.width, self._camera.height)
        self._sharp = context.framebuffer(
            [context.renderbuffer(size, 4, samples=_SAMPLES)], context.depth_renderbuffer(size, samples=_SAMPLES)
        )
        self._plain = context.simple_framebuffer(size, 4)
        self._truth = context.framebuffer([context.renderbuffer(size, 4, dtype="f4")], context.depth_renderbuffer(size))
        half = (max(1, size[0] // 2), max(1, size[1] // 2))
        self._mirror_texture = context.texture(half, 4)
        self._mirror_texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
        self._mirror_texture.repeat_x = self._mirror_texture.repeat_y = False
        self._mirror = context.framebuffer([self._mirror_texture], context.depth_renderbuffer(half))

    def _make_maps(self) -> None:
        context = self._context
        layers = np.stack([fbm(512, 90 + k, slope=s, lowest=low) for k, (s, low) in enumerate(((0.7, 6), (1.5, 2), (1.7, 2)))], 2)
        noise = np.dstack([layers, np.ones((512, 512), np.float32)])
        self._detail = _mipmapped(context, (noise * 255.0).astype(np.uint8))
        puffs = np.stack([fbm(512, 95, slope=1.7, lowest=2), fbm(512, 96, slope=1.4, lowest=3)] * 2, 2)
        self._clouds = _mipmapped(context, (puffs * 255.0).astype(np.uint8))
        light, self._lamp_area = lamp_map(self._world.lamps)
        self._lamps = context.texture(light.shape[::-1], 1, light.tobytes(), dtype="f2", alignment=1)
        self._lamps.repeat_x = self._lamps.repeat_y = False
        self._lamps.filter = (context.LINEAR, context.LINEAR)
        self._shadows = {}
        for name, share in (("still_shadow", 1), ("moving_shadow", 2)):
            texels = _SHADOW_TEXELS // share if self._has_sun else 1
            texture = context.depth_texture((texels, texels))
            texture.compare_func = "<="
            texture.repeat_x = texture.repeat_y = False
            texture.filter = (context.LINEAR, context.LINEAR)
            self._shadows[name] = (texture, context.framebuffer(depth_attachment=texture))

    def colour(self, t_s: float, T_world_cam: SE3) -> npt.NDArray[np.uint8]:
        """The picture as light falls through an ideal pinhole, shape (H, W, 4), RGBA, gamma 2."""
        context = self._context
        context.enable_only(context.DEPTH_TEST)
        placed = placed_actors(self._world, t_s, T_world_cam.t)
        if self._has_sun:
            self._cast_shadows(placed, T_world_cam)
        self._bind_maps()
        view = T_world_cam.inverse().matrix()
        if self._mirrors:
            self._draw(self._mirror, view, placed, T_world_cam, t_s, mirror=True)
            self._mirror_texture.build_mipmaps()
            self._bind_maps()
        self._draw(self._sharp, view, placed, T_world_cam, t_s, mirror=False)
        context.copy_framebuffer(self._plain, self._sharp)
        size = (self._camera.height, self._camera.width, 4)
        return np.frombuffer(self._plain.read(components=4), np.uint8).reshape(size)

    def truth(
        self, t_s: float, T_world_cam: SE3, linear: FloatArray, angular: FloatArray
    ) -> npt.NDArray[np.float32]:
        """Depth (m; 1e9: sky), actor id, and motion (px/s in x and y), shape (H, W, 4).

        `linear` and `angular` are the twist of the robot's body.
        """
        context = self._context
        context.enable_only(context.DEPTH_TEST)
        R_cam_body = self._world.T_body_cam.R.T
        turn = R_cam_body @ angular
        rate = R_cam_body @ (linear + np.cross(angular, self._world.T_body_cam.t))
        view = T_world_cam.inverse().matrix()
        # d/dt of T_cam_world: -[turn]x T_cam_world, and the origin runs backwards.
        spin = np.array([[0.0, -turn[2], turn[1]], [turn[2], 0.0, -turn[0]], [-turn[1], turn[0], 0.0]])
        view_rate = np.zeros((4, 4))
        view_rate[:3] = -spin @ view[:3]
        view_rate[:3, 3] -= rate
        planes = frustum_planes(self._projection @ view, self._reach_m(), T_world_cam.t, T_world_cam.R[:, 2])
        bodies = [body for body in placed_actors(self._world, t_s, T_world_cam.t) if body.is_within(planes)]
        self._truth.use()
        self._truth.clear()
        common = {
            "view": view,
            "view_rate": view_rate,
            "projection": self._projection,
            "focal": (self._camera.fx, self._camera.fy),
        }
        context.front_face = "cw"
        for kind in ("opaque", "cutout"):
            (context.enable if kind == "opaque" else context.disable)(context.CULL_FACE)
            program = self._programs[f"truth {kind}"]
            _set_all(program, {**common, "model": _IDENTITY, "model_rate": _STILL, "id": 0.0})
            for mesh in self._of_kind(self._still, kind):
                self._textured(mesh, program, planes)
            for body in bodies:
                _set(program, "id", float(body.actor.id))
                for part, model, rate in body.parts:
                    _set_all(program, {"model": model, "model_rate": rate})
                    for mesh in self._of_kind(self._meshes(part), kind):
                        self._textured(mesh, program, None)
        context.depth_func = "<="
        _set_all(self._programs["far"], {"rays": self._rays(np.eye(3)), "turn": tuple(turn), "focal": common["focal"]})
        self._empty["far"].render(vertices=3)
        context.depth_func = "<"
        size = (self._camera.height, self._camera.width, 4)
        return np.frombuffer(self._truth.read(components=4, dtype="f4"), np.float32).reshape(size)

    def _draw(
        self,
        target: moderngl.Framebuffer,
        view: FloatArray,
        placed: list[Placed],
        T_world_cam: SE3,
        t_s: float,
        *,
        mirror: bool,
    ) -> None:
        context = self._context
        # The first row of the buffer is the top of the picture, which turns triangles round; a mirror turns them back.
        context.front_face = "ccw" if mirror else "cw"
        eye = T_world_cam.t * ([1.0, 1.0, -1.0] if mirror else [1.0, 1.0, 1.0])
        view = mirrored(view) if mirror else view
        R_world_cam = np.diag([1.0, 1.0, -1.0 if mirror else 1.0]) @ T_world_cam.R
        planes = frustum_planes(self._projection @ view, self._reach_m(), eye, R_world_cam[:, 2])
        target.use()
        target.clear(*np.sqrt(np.clip(self._weather.fog, 0.0, 1.0)).tolist(), 1.0, depth=1.0)
        common = {**self._light(T_world_cam, t_s), "eye": tuple(eye), "view_projection": self._projection @ view}
        common["size"] = tuple(float(v) for v in target.size)
        suffix = " mirrored" if mirror else ""
        bodies = [body for body in placed if body.is_within(planes)]
        self._depths(target, self._programs["depth" + suffix], common, planes, bodies)
        for kind in ("opaque", "decal", "cutout"):
            if kind == "decal":
                # The sky comes before all that lets it shine through.
                self._sky(R_world_cam, common)
            program = self._programs[kind + suffix]
            if kind == "cutout" and not mirror:
                context.enable_direct(_SAMPLE_ALPHA_TO_COVERAGE)
            if kind == "decal":
                context.enable(context.BLEND)
                context.blend_func = context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA
                target.depth_mask = False
            if kind == "opaque":
                context.enable(context.CULL_FACE)
                context.depth_func = "<="
            _set_all(program, {**common, "model": _IDENTITY})
            for mesh in self._of_kind(self._still, kind):
                _set(program, "detail_share", 0.0 if self._world.is_indoors or mesh.material.gloss > 0.1 else 1.0)
                self._shaded(mesh, program, planes)
            _set(program, "detail_share", 0.0)
            for part, model in ((part, model) for body in bodies for part, model, _ in body.parts):
                own = self._of_kind(self._meshes(part), kind)
                if own:
                    _set(program, "model", model)
                for mesh in own:
                    self._shaded(mesh, program, None)
            if kind == "decal":
                target.depth_mask = True
                context.disable(context.BLEND)
            if kind == "opaque":
                context.disable(context.CULL_FACE)
                context.depth_func = "<"
        context.disable_direct(_SAMPLE_ALPHA_TO_COVERAGE)
        self._glows(target, view, placed, eye)

    def _depths(
        self,
        target: moderngl.Framebuffer,
        program: moderngl.Program,
        common: dict[str, object],
        planes: FloatArray,
        bodies: list[Placed],
    ) -> None:
        """Draw the depths of all that is opaque, so that then each pixel is lit but once."""
        context = self._context
        target.color_mask = False, False, False, False
        context.enable(context.CULL_FACE)
        _set_all(program, {"view_projection": common["view_projection"], "model": _IDENTITY})
        for mesh in self._of_kind(self._still, "opaque"):
            mesh.draw(context, program, planes, self._reach_m())
        for part, model in ((part, model) for body in bodies for part, model, _ in body.parts):
            _set(program, "model", model)
            for mesh in self._of_kind(self._meshes(part), "opaque"):
                mesh.draw(context, program, None)
        context.disable(context.CULL_FACE)
        target.color_mask = True, True, True, True

    def _sky(self, R_world_cam: FloatArray, common: dict[str, object]) -> None:
        program = self._programs["sky"]
        _set_all(program, {**common, "rays": self._rays(R_world_cam), "cloud_share": self._weather.clouds})
        self._context.depth_func = "<="
        self._empty["sky"].render(vertices=3)
        self._context.depth_func = "<"

    def _glows(self, target: moderngl.Framebuffer, view: FloatArray, placed: list[Placed], eye: FloatArray) -> None:
        context = self._context
        sprites = glow_sprites(self._world, placed, self._weather, eye)
        if len(sprites) == 0:
            return
        program = self._programs["glow"]
        _set_all(program, {"view": view, "projection": self._projection})
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

    def _cast_shadows(self, placed: list[Placed], T_world_cam: SE3) -> None:
        reach = self._world.shadow_reach_m
        ahead = T_world_cam.t + 0.6 * reach * T_world_cam.R[:, 2] * [1.0, 1.0, 0.0]
        middle = tuple((np.round(ahead / _SHADOW_STEP_M) * _SHADOW_STEP_M * [1.0, 1.0, 0.0]).tolist())
        fresh = middle != self._shadow_middle
        if fresh:
            self._sun_projection = sun_projection(self._sun, np.array(middle), reach, _SHADOW_TEXELS)
            self._shadow_middle = middle
        for name in ("still_shadow", "moving_shadow"):
            if name == "still_shadow" and not fresh:
                continue
            target = self._shadows[name][1]
            target.use()
            target.clear(depth=1.0)
            for kind in ("opaque", "cutout"):
                program = self._programs[f"shadow {kind}"]
                _set_all(program, {"sun_projection": self._sun_projection, "model": _IDENTITY})
                if name == "still_shadow":
                    for mesh in self._of_kind(self._still, kind):
                        self._textured(mesh, program, None)
                    continue
                for body in placed:
                    if float(np.linalg.norm(body.centre - ahead)) > 1.3 * reach:
                        continue
                    for part, model, _ in body.parts:
                        _set(program, "model", model)
                        for mesh in self._of_kind(self._meshes(part), kind):
                            self._textured(mesh, program, None)

    def _light(self, T_world_cam: SE3, t_s: float) -> dict[str, object]:
        w, world = self._weather, self._world
        values: dict[str, object] = {
            "sun_projection": self._sun_projection,
            "sun_direction": tuple(self._sun),
            "sun_light": tuple(2.6 * v for v in w.sun),
            "sky_light": w.sky,
            "bounce_light": w.bounce,
            "fog_light": w.fog,
            "extinction": w.extinction_per_m,
            "exposure": w.exposure,
            "wetness": w.wetness,
            "lamp_area": self._lamp_area,
            "lamp_light": (1.15, 0.80, 0.42) if not world.is_indoors else (0.62, 0.62, 0.58),
        }
        if world.is_indoors:
            dim = 0.12 if w.is_dark else 1.0
            lamps = np.array(values["lamp_light"]) * (0.08 if w.is_dark else 1.0)
            values |= {"sky_light": (0.20 * dim,) * 3, "bounce_light": (0.16 * dim,) * 3, "lamp_light": tuple(lamps)}
        if world.headlights_m is not None:
            T_world_body = T_world_cam @ world.T_body_cam.inverse()
            down = np.array([0.9986, 0.0, -0.035])
            values["headlight"] = tuple(T_world_body.apply(np.array([world.headlights_m]))[0])
            values["headlight_direction"] = tuple(T_world_body.R @ (down / np.linalg.norm(down)))
            values["headlight_power"] = world.headlight_power
        return values

    def _reach_m(self) -> float:
        """How far one sees: in fog, until less than a level of contrast is left."""
        extinction = self._weather.extinction_per_m
        return min(FAR_M, 6.0 / extinction) if extinction > 0.0 else FAR_M

    def _rays(self, R: FloatArray) -> FloatArray:
        """Picture corners (-1 to 1) to rays of a frame, shape (3, 3)."""
        c = self._camera
        inverse = np.array(
            [
                [0.5 * c.width / c.fx, 0.0, (0.5 * c.width - 0.5 - c.cx) / c.fx],
                [0.0, 0.5 * c.height / c.fy, (0.5 * c.height - 0.5 - c.cy) / c.fy],
                [0.0, 0.0, 1.0],
            ]
        )
        return R @ inverse

    def _meshes(self, part: Part) -> list[GpuMesh]:
        key = id(part)
        if key not in self._moving:
            self._moving[key] = [upload(self._context, mesh, chunked=False) for mesh in part.meshes]
        return self._moving[key]

    @staticmethod
    def _of_kind(meshes: list[GpuMesh], kind: str) -> list[GpuMesh]:
        return [mesh for mesh in meshes if _kind(mesh.material) == kind]

    def _texture(self, material: Material) -> moderngl.Texture:
        if material not in self._textures:
            self._textures[material] = texture_of(self._context, material)
        return self._textures[material]

    def _textured(self, mesh: GpuMesh, program: moderngl.Program, planes: FloatArray | None) -> None:
        self._texture(mesh.material).use(_UNITS["image"])
        mesh.draw(self._context, program, planes, self._reach_m())

    def _shaded(self, mesh: GpuMesh, program: moderngl.Program, planes: FloatArray | None) -> None:
        material = mesh.material
        dry = self._weather.wetness if material.is_ground else 0.0
        _set_all(
            program,
            {
                "gloss": material.gloss,
                "glow": material.glow,
                "two_sided": float(material.is_double_sided),
                "wetness": dry,
            },
        )
        self._textured(mesh, program, planes)

    def _bind_maps(self) -> None:
        self._detail.use(_UNITS["detail"])
        self._clouds.use(_UNITS["clouds"])
        self._lamps.use(_UNITS["lamp_map"])
        self._mirror_texture.use(_UNITS["mirror"])
        for name, (texture, _) in self._shadows.items():
            texture.use(_UNITS[name])


def _kind(material: Material) -> str:
    if material.is_decal:
        return "decal"
    return "cutout" if material.is_cutout else "opaque"


def _set(program: moderngl.Program, name: str, value: object) -> None:
    """Set a uniform; one that a weather's program does without is passed over."""
    member = program.get(name, None)
    if member is None:
        return
    if isinstance(value, np.ndarray):
        member.write(np.ascontiguousarray(value.T, np.float32).tobytes())  # type: ignore[union-attr]
    else:
        member.value = value  # type: ignore[union-attr]


def _set_all(program: moderngl.Program, values: dict[str, object]) -> None:
    for name, value in values.items():
        _set(program, name, value)


def _mipmapped(context: moderngl.Context, image: npt.NDArray[np.uint8]) -> moderngl.Texture:
    texture = context.texture((image.shape[1], image.shape[0]), 4, np.ascontiguousarray(image).tobytes())
    texture.build_mipmaps()
    texture.filter = (context.LINEAR_MIPMAP_NEAREST, context.LINEAR)  # broad noise: one mip level does
    return texture
