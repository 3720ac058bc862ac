"""Named keyframes of a model, as postures that an action takes the goal axes to."""

import logging
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from lockstep.protocol.description import Action
from lockstep.robot_bridge.robots.mjcf.drives import Drive
from lockstep.robot_bridge.robots.mjcf.names import label_of

__all__ = ["Keyframe", "keyframes_of"]

MOST: Final = 12
LONGEST_NAME: Final = 200  # characters
ROUNDED: Final = 1e-4  # of the range, by which a keyframe at its end may be out of it

_logger = logging.getLogger(__name__)


class Keyframe(NamedTuple):
    action: Action
    goals: Mapping[int, float]  # rad or m, by number of axis


def keyframes_of(model: Any, drives: Sequence[Drive]) -> dict[str, Keyframe]:
    """Return the named keyframes by the names of their actions; none for a model without goal axes.

    Keyframes after the first MOST are left out, as are those with a value that is not finite, and those whose name
    differs from another's only in characters that cannot be shown; the log names them. A place out of an axis' range
    becomes the end of the range, which the log says too.
    """
    found: dict[str, Keyframe] = {}
    left_out = []
    if all(drive.axis.kind != "goal" for drive in drives):
        return found
    for number in range(model.nkey):
        name = _shown(model.key(number).name)
        if not name:
            continue
        if name in found or len(found) == MOST or not _is_finite(model, number):
            left_out.append(name)
        else:
            found[name] = Keyframe(Action(name=name, label=label_of(name)), _goals(model, number, drives))
    if left_out:
        _logger.warning(
            "at most %d keyframes become actions, each with a name of its own and finite values; left out: %s",
            *(MOST, ", ".join(left_out)),
        )
    return found


def _is_finite(model: Any, key: int) -> bool:
    return bool(np.isfinite(model.key_qpos[key]).all() and np.isfinite(model.key_ctrl[key]).all())


def _shown(name: str) -> str:
    return "".join(each if each.isprintable() else "_" for each in name[:LONGEST_NAME])


def _goals(model: Any, key: int, drives: Sequence[Drive]) -> dict[int, float]:
    return {number: _goal(model, key, drive) for number, drive in enumerate(drives) if drive.axis.kind == "goal"}


def _goal(model: Any, key: int, drive: Drive) -> float:
    actuator, axis = drive.actuator, drive.axis
    if model.key_ctrl[key].any():  # a compiled key without ctrl has zeros
        place = float(model.key_ctrl[key, actuator.number]) / actuator.gear
    else:
        place = float(model.key_qpos[key, model.jnt_qposadr[actuator.joint]])
    if axis.wrap is not None:
        place = math.remainder(place, axis.wrap)
    within = min(max(place, axis.minimum), axis.maximum)
    if abs(within - place) > ROUNDED * (axis.maximum - axis.minimum):
        name = model.key(key).name
        _logger.warning("keyframe %s: %s goes to %g, the end of its range, not to %g", name, axis.name, within, place)
    return within
