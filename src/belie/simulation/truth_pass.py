"""The truth behind a picture: depth, actor and motion of each pixel's middle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray, skew
from belie.simulation.placed import Placed
from belie.simulation.programs import Programs, set_all, set_one
from belie.simulation.projection import FAR_M, frustum_planes, picture_rays, projection_matrix
from belie.simulation.stock import Stock
from belie.simulation.world import World

if TYPE_CHECKING:
    import moderngl

SKY_M = 1.0e8  # what is deeper is sky
_IDENTITY, _STILL = np.eye(4), np.zeros((4, 4))


class TruthPass:
    """Draws depth, ids and motion; made and owned by `Renderer`. One sample a pixel: nothing is mixed."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: Programs,
        stock: Stock,
        world: World,
        camera: CameraModel,
    ) -> None:
        self._context, self._programs, self._stock = context, programs, stock
        self._world, self._camera = world, camera
        self._projection = projection_matrix(camera, world.near_m)
        self._far_array = context.vertex_array(programs["far"], [])
        size = (camera.width, camera.height)
        self._target = context.framebuffer(
            [context.renderbuffer(size, 4, dtype="f4")], context.depth_renderbuffer(size)
        )

    def draw(
        self, placed: list[Placed], T_world_cam: SE3, linear: FloatArray, angular: FloatArray
    ) -> npt.NDArray[np.float32]:
        """Depth (m; above `SKY_M`: sky), actor id, and motion (px/s in x and y), shape (H, W, 4).

        `linear` and `angular` are the twist of the robot's body.
        """
        context = self._context
        R_cam_body = self._world.T_body_cam.R.T
        turn = R_cam_body @ angular
        rate = R_cam_body @ (linear + np.cross(angular, self._world.T_body_cam.t))
        view = T_world_cam.inverse().matrix()
        # d/dt of T_cam_world: the world turns and runs the other way.
        view_rate = np.zeros((4, 4))
        view_rate[:3] = -skew(turn) @ view[:3]
        view_rate[:3, 3] -= rate
        planes = frustum_planes(self._projection @ view, FAR_M, T_world_cam.t, T_world_cam.R[:, 2])
        bodies = [body for body in placed if body.is_within(planes)]
        focal = (self._camera.fx, self._camera.fy)
        common = {"view": view, "view_rate": view_rate, "projection": self._projection, "focal": focal}
        self._target.use()
        self._target.clear()
        context.enable_only(context.DEPTH_TEST | context.CULL_FACE)
        context.front_face = "cw"  # as in `ColourPass`
        self._solids("opaque", common, planes, bodies)
        context.disable(context.CULL_FACE)
        self._solids("cutout", common, planes, bodies)
        context.depth_func = "<="
        rays = picture_rays(self._camera, np.eye(3))
        set_all(self._programs["far"], {"rays": rays, "turn": tuple(turn), "focal": focal})
        self._far_array.render(vertices=3)
        context.depth_func = "<"
        size = (self._camera.height, self._camera.width, 4)
        return np.frombuffer(self._target.read(components=4, dtype="f4"), np.float32).reshape(size)

    def _solids(self, kind: str, common: dict[str, object], planes: FloatArray, bodies: list[Placed]) -> None:
        program = self._programs[f"truth {kind}"]
        set_all(program, {**common, "model": _IDENTITY, "model_rate": _STILL, "id": 0.0})
        for mesh in self._stock.still(kind):
            self._stock.draw(mesh, program, planes)
        for body in bodies:
            set_one(program, "id", float(body.actor.id))
            for part, model, rate in body.parts:
                set_all(program, {"model": model, "model_rate": rate})
                for mesh in self._stock.of_part(part, kind):
                    self._stock.draw(mesh, program, None)
