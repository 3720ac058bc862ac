"""A scripted operator that moves the tool to a place near where it began. No I/O, no clock."""

import math
from collections.abc import Mapping
from typing import Final

from lockstep.bench.pick_place.motions import POSITION, ROTATION
from lockstep.bench.pick_place.script import Hand, ToolHand, by_name
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback

__all__ = ["PLACES", "Visit", "places_near"]

PLACES: Final = (
    (0.03, -0.05, -0.03),
    (0.0, 0.05, 0.02),
    (-0.03, -0.02, 0.03),
    (0.02, 0.04, -0.02),
)  # m, from the begin
THERE: Final = 0.006  # m
LONGEST: Final = 5.0  # s of the robot's clock
LEAST: Final = 5  # events, so that an episode has rows


def places_near(description: RobotDescription, feedback: Feedback) -> list[dict[str, float]]:
    """Return goals of the tool for each of PLACES, from where it is measured now, turned as it is now."""
    here = by_name(description, feedback.axes)
    turned = {name: here[name] for name in ROTATION}
    return [
        turned | {name: here[name] + offset for name, offset in zip(POSITION, offsets, strict=True)}
        for offsets in PLACES
    ]


class Visit:
    """One place. `done` once the tool is there, or after LONGEST: it is the data that counts, not the place.

    Attributes:
        failed: never anything, as an operator's script may
        reached: the tool is there
        answered: feedbacks, each of which answered a command of this operator
        first_event: of the first of them; 0 before it
        last_event: of the last of them
    """

    def __init__(self, description: RobotDescription, goals: Mapping[str, float], hand: Hand | None = None) -> None:
        """`hand`: None: the tool's place is driven, and it may turn."""
        self._description = description
        self._goals = goals if hand is not None else {name: goals[name] for name in POSITION}
        self._hand = ToolHand(description) if hand is None else hand
        self._begun: float | None = None  # s, of the robot's clock
        self.answered = 0
        self.first_event = 0
        self.last_event = 0
        self.failed = ""
        self.reached = False
        self.done = False

    def values(self, feedback: Feedback) -> list[float | None]:
        """Return the values of the command that answers this feedback."""
        self._begun = feedback.time if self._begun is None else self._begun
        self.answered += 1
        self.first_event = self.first_event or feedback.event
        self.last_event = feedback.event
        here = by_name(self._description, feedback.axes)
        way = math.dist([here[name] for name in POSITION], [self._goals[name] for name in POSITION])
        self.reached = way < THERE
        late = feedback.time - self._begun > LONGEST
        self.done = self.answered > LEAST and (self.reached or late)
        named = self._hand.values(self._goals, feedback)
        return [None if self.done else named.get(axis.name) for axis in self._description.axes]
