"""Reads which servos of a model are driven by goals: `<custom><text name="lockstep_goals" data="…"/></custom>`.

`lockstep_grippers` names those that besides squeeze what they hold.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf.actuators import Actuator, Kind
from lockstep.robot_bridge.robots.mjcf.texts import words_of

__all__ = ["goal_actuators", "gripper_actuators"]

GOALS: Final = "lockstep_goals"
GRIPPERS: Final = "lockstep_grippers"
ALL: Final = "all"


def goal_actuators(model: Any, actuators: Sequence[Actuator]) -> set[int]:
    """Return the numbers of the position servos that are goal axes.

    Raises:
        ModelError: the text names an actuator that does not exist or cannot be one.
    """
    words = words_of(model, GOALS)
    servos = _servos(actuators)
    if words == [ALL]:
        return {each.number for each in servos.values()}
    return _numbers(GOALS, words, servos)


def gripper_actuators(model: Any, actuators: Sequence[Actuator], arms: Collection[int]) -> set[int]:
    """Return the numbers of the position servos that are goal axes and grip. `arms`: of those that tools move.

    Raises:
        ModelError: the text names an actuator that does not exist, cannot be a goal axis, or is one of an arm's.
    """
    found = _numbers(GRIPPERS, words_of(model, GRIPPERS), _servos(actuators))
    if of_arms := [each.name for each in actuators if each.number in found and each.number in arms]:
        raise ModelError(f"{GRIPPERS} names {of_arms[0]!r}, which moves a tool: a gripper is a joint of the hand")
    return found


def _servos(actuators: Sequence[Actuator]) -> dict[str, Actuator]:
    return {each.name: each for each in actuators if each.kind is Kind.POSITION and each.joint is not None}


def _numbers(text: str, words: Sequence[str], servos: Mapping[str, Actuator]) -> set[int]:
    for word in words:
        if word not in servos:
            known = ", ".join(servos) or "none"
            raise ModelError(f"{text} names {word!r}, which is no position actuator of a joint; there are: {known}")
    return {servos[word].number for word in words}
