"""How the feedback and the result of an action are read. No I/O."""

from typing import Any

from lockstep.robot_bridge.robots.ros2.actions.goal_fields import number_at, text_at
from lockstep.robot_bridge.robots.ros2.actions.goals import Reading
from lockstep.robot_bridge.robots.ros2.sensing.words import words_of

__all__ = ["FieldReading", "GripperReading"]

LEAST = 1e-6  # of what is left, in its own unit


class FieldReading(Reading):
    """Reads the fields that the settings name."""

    def __init__(self, *, left: str = "", progress: str = "", text: str = "", result: str = "", unit: str = "") -> None:
        """`left`: a number that goes to 0. `progress`: one that goes from 0 to 1. `unit`: of what is left."""
        self._left = left
        self._progress = progress
        self._text = text
        self._result = result
        self._unit = unit
        self._most = 0.0  # that was left at any time

    def progress(self, feedback: Any) -> tuple[float, str]:
        share, words = 0.0, ""
        if self._left:
            left = number_at(feedback, self._left)
            self._most = max(self._most, left)
            share = 1 - left / max(self._most, LEAST)
            words = f"{left:.1f}{' ' if self._unit else ''}{self._unit} to go"
        if self._progress:
            share = number_at(feedback, self._progress)
        if self._text:
            words = words_of(text_at(feedback, self._text))
        return min(max(share, 0.0), 1.0), words

    def result(self, result: Any) -> str:
        return words_of(text_at(result, self._result)) if self._result else ""


class GripperReading(Reading):
    """Reads control_msgs/GripperCommand. A gripper that stands still around a thing has done what it could."""

    def __init__(self, unit: str) -> None:
        self._unit = unit

    def progress(self, feedback: Any) -> tuple[float, str]:
        return 0.0, f"at {number_at(feedback, 'position'):.3g} {self._unit}"

    def result(self, result: Any) -> str:
        where = f"at {number_at(result, 'position'):.3g} {self._unit}"
        return f"{where}, holds something" if result.stalled and not result.reached_goal else where

    def succeeded(self, result: Any) -> bool:
        return bool(result.reached_goal or result.stalled)
