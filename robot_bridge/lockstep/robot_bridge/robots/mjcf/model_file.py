"""Reads a model's file, and names its fault in one sentence."""

import logging
import math
from pathlib import Path
from typing import Any, Final

import mujoco

from lockstep.robot_bridge.errors import ModelError

__all__ = ["load_model"]

_logger = logging.getLogger(__name__)

MOST_ACTUATORS: Final = 64
LONGEST_STEP: Final = 0.02  # s
LONGEST_REASON: Final = 400  # characters


def load_model(path: Path) -> Any:
    """Return the compiled MjModel.

    Raises:
        ModelError: the model cannot be used.
    """
    mujoco.set_mju_user_warning(_warn)  # else MuJoCo writes a file into the working directory
    if path.is_dir():
        raise ModelError(f"{path} is a folder, not an MJCF file")
    if not path.is_file():
        raise ModelError(f"{path} does not exist")
    model = _compiled(path)
    if model.nu == 0:
        raise ModelError(f"{path} has no actuators: there is nothing to drive. Add some in <actuator>")
    if model.nu > MOST_ACTUATORS:
        raise ModelError(f"{path} has {model.nu} actuators; at most {MOST_ACTUATORS} can be driven")
    step = float(model.opt.timestep)
    if not (math.isfinite(step) and 0 < step <= LONGEST_STEP):
        raise ModelError(f"{path}: a timestep of {step:g} s is too long, the most is {LONGEST_STEP:g} s")
    return model


def _compiled(path: Path) -> Any:
    try:
        if path.suffix == ".mjb":
            return mujoco.MjModel.from_binary_path(str(path))
        return mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError, UnicodeError) as error:
        raise ModelError(_reason(path, str(error))) from error


def _reason(path: Path, text: str) -> str:
    """Return MuJoCo's message on one line, after its meaning."""
    words = " ".join(text.split()).removeprefix("Error: ")[:LONGEST_REASON]
    if "Error opening file" in words:
        return f"{path} names a file that is missing: {words}"
    if "XML parse error" in words or "ParseXML" in words:
        return f"{path} is not well-formed XML: {words}"
    return f"{path} is not a valid MuJoCo model: {words}"


def _warn(text: str) -> None:
    _logger.warning("MuJoCo: %s", text)
