"""A scripted operator of the SO-101: puts a block into the bowl by goals.

It answers each feedback with one command, so that it runs over any link and any network: `Operator`-like test helpers,
`RobotLink`, or the headless client (`feedback = await console.drive(task.values(feedback))`). No I/O, no clock.

It knows where the blocks and the bowl begin, which the robot's action `reset_scene` restores; it sees nothing.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final, Protocol, TypeVar

from lockstep.bench.pick_place.motions import POSITION, ROTATION, Motion, Place, motions
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback

__all__ = ["APPLIED", "Hand", "PickAndPlace", "ToolHand"]

STEP: Final = 0.07  # m, of a goal ahead of the measured tool: less than its reach
THERE: Final = 0.006  # m, of the measured tool
APPLIED: Final = 0.02  # rad and m, of the applied goal
STANDS: Final = 0.01  # rad, from one feedback to the next: the tool does not turn
PAUSE: Final = 0.25  # s of the robot's clock that a motion settles for
LONGEST: Final = 60.0  # s for one motion, on a busy machine too

Value = TypeVar("Value", float, float | None)


class Hand(Protocol):
    """The way in which a motion becomes a command."""

    def think(self, goals: Mapping[str, float], feedback: Feedback) -> None:
        """Compute what `values` and `applied` need for these goals, if that takes long."""

    def values(self, goals: Mapping[str, float], feedback: Feedback) -> Mapping[str, float | None]:
        """Return values by axis that answer the feedback and lead to these goals of the tool or the gripper."""

    def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
        """Return whether what it commands for these goals is applied."""


def by_name(description: RobotDescription, values: Sequence[Value]) -> dict[str, Value]:
    """Return one value per axis of a feedback by the axes' names."""
    return {axis.name: value for axis, value in zip(description.axes, values, strict=True)}


class ToolHand:
    """Drives the tool's pose; the robot solves the joints for it."""

    def __init__(self, description: RobotDescription) -> None:
        self._description = description
        self._turned: dict[str, float] = {}  # rad, how the tool was measured to be turned before

    def think(self, goals: Mapping[str, float], feedback: Feedback) -> None:
        """The robot does."""

    def values(self, goals: Mapping[str, float], feedback: Feedback) -> Mapping[str, float | None]:
        here = by_name(self._description, feedback.axes)
        way = {name: goals[name] - here[name] for name in POSITION if name in goals}
        distance = math.hypot(*way.values()) if way else 0.0
        share = min(1.0, STEP / distance) if distance else 1.0
        place = {name: here[name] + share * each if share < 1 else goals[name] for name, each in way.items()}
        return dict(goals) | place

    def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
        """A tool that the joints cannot turn so far is turned as far as they can when it does not turn any more."""
        there, here = by_name(self._description, feedback.goals), by_name(self._description, feedback.axes)
        before, self._turned = self._turned, {name: here[name] for name in ROTATION if name in goals}
        stands = all(abs(each - before.get(name, math.inf)) < STANDS for name, each in self._turned.items())
        judged = goals.keys() - self._turned.keys() if stands else goals.keys()
        return all((goal := there[name]) is not None and abs(goal - goals[name]) < APPLIED for name in judged)


class PickAndPlace:
    """One block. `done` once it is in the bowl and the tool is above it.

    Attributes:
        done: the script is at its end
        motions_done: of the nine
        failed: what went wrong; "" as long as nothing did
    """

    def __init__(
        self,
        description: RobotDescription,
        block: str,
        hand: Hand | None = None,
        place: Place | None = None,
        longest: float = LONGEST,
        bowl: tuple[float, float] | None = None,
    ) -> None:
        """
        Args:
            block: one of BLOCKS
            hand: None: the tool's pose is driven
            place: of the block; None: where the scene begins
            longest: s that one motion may take
            bowl: m, where to let go of the block; None: beside the other blocks in the bowl
        """
        self._longest = longest
        self._description = description
        self._index = {axis.name: number for number, axis in enumerate(description.axes)}
        self._hand = ToolHand(description) if hand is None else hand
        self._motions = motions(block, place, bowl)
        self._motion = next(self._motions, None)  # the present one
        self._begun: float | None = None  # s, of the robot's clock
        self._there: float | None = None
        self._newest: Feedback | None = None
        self.motions_done = 0
        self.failed = ""

    @property
    def done(self) -> bool:
        return self._motion is None

    def values(self, feedback: Feedback) -> list[float | None]:
        """Return the values of the command that answers this feedback; all None once it is done."""
        self.think(feedback)
        if self._motion is None or self.failed:
            return [None] * len(self._index)
        named = self._hand.values(self._motion.goals, feedback)
        return [named.get(name) for name in self._index]

    def think(self, feedback: Feedback) -> None:
        """Compute what the answer to this feedback needs; in another thread, if nobody else calls meanwhile."""
        if feedback is self._newest:
            return
        self._newest = feedback
        self._go_on(feedback)
        if self._motion is not None and not self.failed:
            self._hand.think(self._motion.goals, feedback)

    def _go_on(self, feedback: Feedback) -> None:
        """Begin the next motion when the present one has settled."""
        if self._motion is None:
            return
        self._begun = feedback.time if self._begun is None else self._begun
        if not self._is_there(self._motion, feedback):
            self._there = None
            if feedback.time - self._begun > self._longest:
                self.failed = f"after {self._longest:g} s {self.where()}"
            return
        self._there = feedback.time if self._there is None else self._there
        if feedback.time - self._there >= PAUSE:
            self._motion = next(self._motions, None)
            self.motions_done += 1
            self._begun = self._there = None

    def where(self) -> str:
        """Say which motion goes on, and where each axis is that it moves, by the newest feedback."""
        motion, feedback = self._motion, self._newest
        if motion is None or feedback is None:
            return "the arm has not begun" if feedback is None else "all motions are done"
        here, there = by_name(self._description, feedback.axes), by_name(self._description, feedback.goals)
        places = [
            f"{name} is {here[name]:.3f}, its goal {_number(there[name])}, wanted {goal:.3f}"
            for name, goal in motion.goals.items()
        ]
        words = [*places, *feedback.faults, *feedback.limits]
        return f"while it {motion.name} (motion {self.motions_done + 1}): {'; '.join(words)}"

    def _is_there(self, motion: Motion, feedback: Feedback) -> bool:
        place = [feedback.axes[self._index[name]] - motion.goals[name] for name in POSITION if name in motion.goals]
        if motion.must_arrive and math.hypot(*place) >= THERE:
            return False
        return self._hand.applied(motion.goals, feedback)


def _number(goal: float | None) -> str:
    return "nothing" if goal is None else f"{goal:.3f}"
