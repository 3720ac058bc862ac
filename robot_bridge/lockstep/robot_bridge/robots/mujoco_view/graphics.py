"""Chooses the way to OpenGL, and says what to do if OpenGL is missing. Imports nothing of MuJoCo."""

import logging
import os

from lockstep.robot_bridge.errors import RobotUnavailable

__all__ = ["choose_graphics", "graphics_unavailable"]

ADVICE = (
    "Its cameras need OpenGL through EGL: on Debian or Ubuntu install libegl1 and libgl1-mesa-dri. "
    "`--robot planar` runs without OpenGL."
)


def choose_graphics() -> None:
    """Render off screen through EGL unless the environment says otherwise; no effect after mujoco was imported."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    # Without a GPU Mesa rasterises on the CPU. Done in the thread that draws, a picture of this size costs a quarter
    # less processor time than with one thread besides.
    os.environ.setdefault("LP_NUM_THREADS", "0")
    # PyOpenGL reports at every start that its optional accelerator is absent; nothing here would use it.
    logging.getLogger("OpenGL").setLevel(logging.WARNING)


def graphics_unavailable(cause: BaseException) -> RobotUnavailable:
    """Return the error for an OpenGL that failed with `cause`, or for a package that is not installed."""
    if isinstance(cause, ModuleNotFoundError):
        return RobotUnavailable(
            f"this robot needs {cause.name}, which is not installed. In a checkout: "
            ".venv/bin/python -m pip install -e './robot_bridge[sim]'; elsewhere install lockstep-bridge[sim]. "
            "`--robot planar` runs without it"
        )
    choice = os.environ.get("MUJOCO_GL", "")
    return RobotUnavailable(f"OpenGL is not available (MUJOCO_GL={choice}: {type(cause).__name__}: {cause}). {ADVICE}")
