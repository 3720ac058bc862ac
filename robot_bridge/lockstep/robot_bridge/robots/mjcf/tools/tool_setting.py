"""Reads which tools of a model are driven by their pose: `<custom><text name="lockstep_tool" data="…"/></custom>`.

A tool is a site or a body; the pose of "grip@overview" is in the frame of the camera "overview". The joints that a pose
drives are those above the tool, up to the first one that no position actuator moves.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import mujoco

from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf.actuators import Actuator, Kind
from lockstep.robot_bridge.robots.mjcf.names import name_of
from lockstep.robot_bridge.robots.mjcf.texts import words_of

__all__ = ["ModelTool", "tools_of"]

TEXT: Final = "lockstep_tool"
FEWEST: Final = 3  # joints: with less, no tool can be moved in three directions


class ModelTool(NamedTuple):
    name: str  # "grip_site"
    camera: str  # in whose frame the pose is; "": in that of what the arm stands on
    site: int | None  # None: the tool is the body itself
    path: tuple[int, ...]  # bodies, from that on which the arm stands to the tool's
    servos: tuple[Actuator, ...]  # of the joints, from the base to the tool


def tools_of(model: Any, actuators: Sequence[Actuator]) -> list[ModelTool]:
    """Return the tools that the model names.

    Raises:
        ModelError: a tool does not exist, cannot be driven, or shares joints with another.
    """
    servos: dict[int, list[Actuator]] = {}
    for each in actuators:
        if each.joint is not None and each.kind is Kind.POSITION:
            servos.setdefault(each.joint, []).append(each)
    by_joint = {joint: found[0] for joint, found in servos.items() if len(found) == 1}
    tools: list[ModelTool] = []
    for word in words_of(model, TEXT):
        tool = _tool(model, word, by_joint)
        taken = {each.number for other in tools for each in other.servos}
        if any(each.number in taken for each in tool.servos):
            raise ModelError(f"{TEXT} names {word!r}, whose joints another tool has")
        tools.append(tool)
    return tools


def _tool(model: Any, word: str, servos: dict[int, Actuator]) -> ModelTool:
    name, at, camera = word.partition("@")
    if at and not camera:
        raise ModelError(f"{TEXT} names {word!r}, and no camera behind the @")
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    body = int(model.site_bodyid[site]) if site >= 0 else mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    if body < 0:
        raise ModelError(f"{TEXT} names {name!r}, which is neither a site nor a body")
    if camera and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera) < 0:
        raise ModelError(f"{TEXT} names {word!r}, and the model has no camera {camera!r}")
    path, found = [body], list[Actuator]()
    while path[0]:
        first = int(model.body_jntadr[path[0]])
        joints = range(first, first + int(model.body_jntnum[path[0]]))
        if any(joint not in servos for joint in joints):
            break
        found[:0] = [servos[joint] for joint in joints]
        path.insert(0, int(model.body_parentid[path[0]]))
    if len(found) < FEWEST:
        above = "the world" if not path[0] else name_of(model, "body", path[0])
        raise ModelError(
            f"{TEXT} names {name!r}, between which and {above} are {len(found)} joints with a position actuator each;"
            f" a pose needs {FEWEST}"
        )
    return ModelTool(name, camera, site if site >= 0 else None, tuple(path), tuple(found))
