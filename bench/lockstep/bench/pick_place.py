"""A scripted operator of the SO-101: puts a block into the bowl, by goals of the tool's pose and the gripper.

It answers each feedback with one command, so that it runs over any link and any network: `Operator`-like test helpers,
`RobotLink`, or the headless client (`feedback = await console.drive(task.values(feedback))`). No I/O, no clock.

It knows where the blocks and the bowl begin, which the robot's action `reset_scene` restores; it sees nothing.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback

__all__ = ["BLOCKS", "PickAndPlace"]


class Place(NamedTuple):
    x: float  # m
    y: float
    yaw: float  # rad


BLOCKS: Final[Mapping[str, Place]] = {  # robots/so101/scene.xml
    "red": Place(0.25, -0.09, 0.0),
    "green": Place(0.29, 0.01, math.radians(20)),
    "blue": Place(0.20, -0.03, math.radians(-35)),
}
IN_BOWL: Final[Mapping[str, tuple[float, float]]] = {  # m, beside each other in the bowl, which is at 0.20, 0.16
    "red": (0.220, 0.160),
    "green": (0.190, 0.178),
    "blue": (0.190, 0.142),
}
AXIS: Final = 0.0388  # m, where the arm pans about: a block's side that faces it is gripped
GRIP, ABOVE, OVER_BOWL, CARRY = 0.016, 0.08, 0.085, 0.13  # m, height of the tool
OPEN, SHUT = 0.75, -0.10  # rad, of the gripper
POSITION: Final = ("tool.x", "tool.y", "tool.z")
ROTATION: Final = ("tool.rx", "tool.ry", "tool.rz")
STEP: Final = 0.07  # m, of a goal ahead of the measured tool: less than its reach
THERE: Final = (0.006, 0.02)  # m of the measured tool, rad and m of the applied goal
PAUSE: Final = 0.25  # s of the robot's clock that a motion settles for
LONGEST: Final = 15.0  # s for one motion


class _Motion(NamedTuple):
    goals: dict[str, float]
    must_arrive: bool  # the tool, measured


class PickAndPlace:
    """One block. `done` once it is in the bowl and the tool is above it.

    Attributes:
        done: the script is at its end
        failed: what went wrong; "" as long as nothing did
    """

    def __init__(self, description: RobotDescription, block: str) -> None:
        """`block`: one of BLOCKS."""
        self._index = {axis.name: number for number, axis in enumerate(description.axes)}
        self._motions = _motions(BLOCKS[block], IN_BOWL[block])
        self._motion = next(self._motions, None)  # the present one
        self._begun: float | None = None  # s, of the robot's clock
        self._there: float | None = None
        self.failed = ""

    @property
    def done(self) -> bool:
        return self._motion is None

    def values(self, feedback: Feedback) -> list[float | None]:
        """Return the values of the command that answers this feedback; all None once it is done."""
        values: list[float | None] = [None] * len(self._index)
        self._go_on(feedback)
        if self._motion is None or self.failed:
            return values
        goals = self._motion.goals
        for name, goal in goals.items():
            values[self._index[name]] = goal
        way = {name: goals[name] - feedback.axes[self._index[name]] for name in POSITION if name in goals}
        share = min(1.0, STEP / max(math.hypot(*way.values()), 1e-9)) if way else 1.0
        for name, distance in way.items():
            values[self._index[name]] = (
                feedback.axes[self._index[name]] + share * distance if share < 1 else goals[name]
            )
        return values

    def _go_on(self, feedback: Feedback) -> None:
        """Begin the next motion when the present one has settled."""
        if self._motion is None:
            return
        self._begun = feedback.time if self._begun is None else self._begun
        if not self._is_there(self._motion, feedback):
            self._there = None
            if feedback.time - self._begun > LONGEST:
                self.failed = f"after {LONGEST:g} s the arm is not at {self._motion.goals}"
            return
        self._there = feedback.time if self._there is None else self._there
        if feedback.time - self._there >= PAUSE:
            self._motion = next(self._motions, None)
            self._begun = self._there = None

    def _is_there(self, motion: _Motion, feedback: Feedback) -> bool:
        numbers = {self._index[name]: goal for name, goal in motion.goals.items()}
        applied = all(
            (there := feedback.goals[number]) is not None and abs(there - goal) < THERE[1]
            for number, goal in numbers.items()
        )
        place = [feedback.axes[self._index[name]] - motion.goals[name] for name in POSITION if name in motion.goals]
        return applied and (not motion.must_arrive or math.hypot(*place) < THERE[0])


def _motions(block: Place, bowl: tuple[float, float]) -> Iterator[_Motion]:
    facing = math.atan2(block.y, block.x - AXIS)
    quarter = math.pi / 2
    aligned = (block.yaw - facing + quarter / 2) % quarter - quarter / 2 + facing
    down = dict(zip(ROTATION, _pointing_down(aligned), strict=True))
    over = dict(zip(ROTATION, _pointing_down(math.atan2(bowl[1], bowl[0] - AXIS)), strict=True))
    yield _Motion({"gripper": OPEN}, must_arrive=False)
    yield _Motion(_at(block.x, block.y, ABOVE) | down, must_arrive=True)
    yield _Motion(_at(block.x, block.y, GRIP) | down, must_arrive=True)
    yield _Motion({"gripper": SHUT}, must_arrive=False)
    yield _Motion(_at(block.x, block.y, CARRY) | down, must_arrive=True)
    yield _Motion(_at(*bowl, CARRY) | over, must_arrive=True)
    yield _Motion(_at(*bowl, OVER_BOWL) | over, must_arrive=True)
    yield _Motion({"gripper": OPEN}, must_arrive=False)
    yield _Motion(_at(*bowl, CARRY) | over, must_arrive=True)


def _at(x: float, y: float, z: float) -> dict[str, float]:
    return dict(zip(POSITION, (x, y, z), strict=True))


def _pointing_down(yaw: float) -> tuple[float, float, float]:
    """Return the rotation vector of a tool that points down, turned by `yaw` about the vertical.

    It is a quarter turn about y and then the yaw about z, composed as quaternions.
    """
    half, turn = math.pi / 4, yaw / 2
    w, x, y, z = (
        math.cos(turn) * math.cos(half),
        -math.sin(turn) * math.sin(half),
        math.cos(turn) * math.sin(half),
        math.sin(turn) * math.cos(half),
    )
    length = math.hypot(x, y, z)
    angle = 2 * math.atan2(length, w)
    return (x / length * angle, y / length * angle, z / length * angle)
