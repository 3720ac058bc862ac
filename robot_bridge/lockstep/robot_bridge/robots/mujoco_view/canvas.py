"""Draws one state of the model to pixels. Everything here belongs to the thread that made the canvas."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.mujoco_view.read_back import drop_stencil, read_rgba

__all__ = ["DEFAULT_LOOK", "FREE_CAMERA", "Canvas", "Look"]

FREE_CAMERA: Final = -1  # looks at the middle of the model, from a distance that fits its extent


class Look(NamedTuple):
    """The parts of a model that are drawn."""

    groups: tuple[int, ...] = (0, 1, 1, 0, 1, 0)  # of geoms: 1 for those that are drawn; group 3 is collision hulls
    max_geoms: int = 400
    cameras: Mapping[str, int] = {}  # number of a camera in the model, or FREE_CAMERA; others go by their name
    has_soft_parts: bool = False  # tendons, skins and flexible bodies, which need more of the kinematics


DEFAULT_LOOK: Final = Look()


class Canvas:
    """One OpenGL context and one simulation state, shared by all cameras."""

    def __init__(self, model: Any, width: int, height: int, look: Look = DEFAULT_LOOK) -> None:
        """`width` and `height`: of the largest picture."""
        self._look = look
        self._model = model
        self._data = mujoco.MjData(model)
        self._gl = mujoco.GLContext(width, height)
        self._gl.make_current()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        drop_stencil(self._context, self._context.offWidth, self._context.offHeight)
        self._scene = mujoco.MjvScene(model, look.max_geoms)
        self._scene.flags[:] = 0  # no shadows, no reflections, no fog: on a CPU they cost ten times the rest
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 1
        self._scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 1
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = look.groups
        self._options.sitegroup[:] = 0
        self._options.flags[:] = 0
        self._options.flags[mujoco.mjtVisFlag.mjVIS_STATIC] = 1
        self._options.flags[mujoco.mjtVisFlag.mjVIS_TEXTURE] = 1
        if look.has_soft_parts:
            for flag in ("TENDON", "SKIN", "FLEXFACE", "FLEXSKIN"):
                self._options.flags[getattr(mujoco.mjtVisFlag, f"mjVIS_{flag}")] = 1
        self._views: dict[str, Any] = {}

    def draw(self, camera: str, positions: npt.NDArray[np.float64], pixels: npt.NDArray[np.uint8]) -> None:
        """Fill `pixels` (height, width, RGBA) with the camera's view, the lowest row first."""
        height, width, _ = pixels.shape
        self._data.qpos[:] = positions
        self._pose()
        everything = mujoco.mjtCatBit.mjCAT_ALL
        view = self._views.get(camera) or self._views.setdefault(camera, self._view(camera))
        mujoco.mjv_updateScene(
            self._model, self._data, self._options, mujoco.MjvPerturb(), view, everything, self._scene
        )
        viewport = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(viewport, self._scene, self._context)
        read_rgba(pixels, viewport)

    def _pose(self) -> None:
        mujoco.mj_kinematics(self._model, self._data)
        if self._look.has_soft_parts:
            mujoco.mj_comPos(self._model, self._data)
            mujoco.mj_flex(self._model, self._data)
            mujoco.mj_tendon(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)

    def _view(self, camera: str) -> Any:
        view = mujoco.MjvCamera()
        number = self._look.cameras.get(camera)
        if number == FREE_CAMERA:
            mujoco.mjv_defaultFreeCamera(self._model, view)
            return view
        view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        view.fixedcamid = self._model.camera(camera).id if number is None else number
        return view

    def close(self) -> None:
        self._context.free()
        self._gl.free()
