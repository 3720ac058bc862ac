"""Draws one state of the model to pixels. Everything here belongs to the thread that made the canvas."""

from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

__all__ = ["Canvas"]

MAX_GEOMS: Final = 400
DRAWN_GROUPS: Final = (0, 1, 1, 0, 1, 0)  # of geoms; group 3 is collision hulls


class Canvas:
    """One OpenGL context, shared by all cameras, with a state of its own."""

    def __init__(self, model: Any, width: int, height: int) -> None:
        """`width` and `height` of the largest picture."""
        self._model = model
        self._data = mujoco.MjData(model)
        self._gl = mujoco.GLContext(width, height)
        self._gl.make_current()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(model, MAX_GEOMS)
        self._scene.flags[:] = 0  # no shadows, no reflections, no fog: on a CPU they cost ten times the rest
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 1
        self._scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 1
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = DRAWN_GROUPS
        self._options.sitegroup[:] = 0
        self._options.flags[:] = 0
        self._options.flags[mujoco.mjtVisFlag.mjVIS_STATIC] = 1
        self._options.flags[mujoco.mjtVisFlag.mjVIS_TEXTURE] = 1
        self._pixels: dict[tuple[int, int], npt.NDArray[np.uint8]] = {}

    def draw(self, camera: str, width: int, height: int, positions: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
        """RGB rows from the top, as a view that the next picture of this size overwrites."""
        self._data.qpos[:] = positions
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        view = mujoco.MjvCamera()
        view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        view.fixedcamid = self._model.camera(camera).id
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, self._data, self._options, mujoco.MjvPerturb(), view, everything, self._scene
        )
        viewport = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(viewport, self._scene, self._context)
        pixels = self._pixels.setdefault((height, width), np.empty((height, width, 3), np.uint8))
        mujoco.mjr_readPixels(pixels, None, viewport, self._context)
        return pixels[::-1]  # OpenGL's first row is the lowest

    def close(self) -> None:
        self._context.free()
        self._gl.free()
