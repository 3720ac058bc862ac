"""A person with a gamepad, who looks where the tool is and moves sticks and buttons. No I/O, no clock."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from lockstep.bench.pick_place.motions import POSITION, ROTATION
from lockstep.bench.pick_place.script import by_name
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Feedback

__all__ = ["DPAD", "SLOW_SHARE", "PadHand", "PadMove", "deflection", "gain_for"]

STICKS: Final = {"left_x": 0, "left_y": 1, "right_x": 2, "right_y": 3}  # W3C standard mapping: numbers of axes
DPAD: Final = {"dpad_x": (14, 15), "dpad_y": (12, 13)}  # numbers of buttons: negative, positive
LEFT_TRIGGER, RIGHT_TRIGGER = 6, 7
DEADZONE, EXPO = 0.12, 0.35  # of the page's sticks and triggers (docs/gamepads.md)
CLOSE: Final = {"m": 0.002, "rad": 0.03}  # from where it is to be: the stick is let go
# The cross knows no half: far away it is pressed as it is, near with the slow button, in between nobody touches it.
FAR_TURN, NEAR_TURN = 0.5, 0.07  # rad
SLOW_SHARE: Final = 0.15  # of full speed, with the slow button held
SLOW_ENOUGH: Final = 0.3  # of full speed, below which the sticks go on while it is held
TURNED: Final = 0.1  # rad, of the measured tool: as far as a person can see it
GRIPPED: Final = 0.05  # rad, of the gripper's applied goal
STANDS: Final = 0.004  # rad, from one feedback to the next
PATIENCE: Final = 8  # feedbacks in which it is pushed and does not turn: the joints cannot turn it further
# m and feedbacks: a tool that is pushed and does not move further in so many is pushed twice as hard, up to a share.
MOVES, HARDER, HARDEST = 0.0005, 3, 0.5
GAINS: Final = (0.5, 4.0)  # 1/s, of the speed by the distance


@dataclass
class PadMove:
    """What the hand does now; what is not named is let go.

    Attributes:
        sticks: -1 to 1 by the number of the pad's axis
        triggers: 0 to 1 by the number of the button
        pressed: numbers of the buttons of the cross
        slow: the slow button is held
    """

    sticks: dict[int, float] = field(default_factory=dict)
    triggers: dict[int, float] = field(default_factory=dict)
    pressed: set[int] = field(default_factory=set)
    slow: bool = False


def gain_for(delay: float) -> float:
    """Return how fast a hand goes to what it sees `delay` s late, in 1/s: it must not go past it."""
    return min(max(0.8 / delay, GAINS[0]), GAINS[1]) if delay > 0 else GAINS[1]


def deflection(share: float) -> float:
    """Return where a stick or trigger is to be for a share of full speed, -1 to 1: the page's shaping, inverted."""
    size = min(abs(share), 1.0)
    if size == 0.0:
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if (1 - EXPO) * middle + EXPO * middle**3 < size else (low, middle)
    return math.copysign(DEADZONE + (1 - DEADZONE) * high, share)


class PadHand:
    """Wants the motion's goals themselves, and moves the tool there by the rates that the pad's sticks are."""

    def __init__(self, description: RobotDescription) -> None:
        self._description = description
        self._axes = {axis.name: axis for axis in description.axes}
        self._goals: Mapping[str, float] = {}
        self._waited: dict[str, int] = {}  # feedbacks that a place was pushed and did not move, by axis
        self._stood: dict[str, int] = {}  # feedbacks that a rotation was pushed in and stood, by axis
        self._before: dict[str, float] = {}
        self._pushed: set[str] = set()

    def think(self, goals: Mapping[str, float], feedback: Feedback) -> None:
        """A person looks."""

    def values(self, goals: Mapping[str, float], feedback: Feedback) -> Mapping[str, float | None]:
        if goals is not self._goals:
            self._goals, self._stood, self._waited, self._before = goals, {}, {}, {}
        self._watch(by_name(self._description, feedback.axes))
        return dict(goals)

    def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
        """The tool is turned as wanted, as far as the joints can; the gripper's goal is the one that is wanted."""
        here, there = by_name(self._description, feedback.axes), by_name(self._description, feedback.goals)
        turned = all(
            abs(here[name] - goals[name]) < TURNED or self._is_stuck(name) for name in ROTATION if name in goals
        )
        grip = there["gripper"]
        return turned and ("gripper" not in goals or (grip is not None and abs(grip - goals["gripper"]) < GRIPPED))

    def move(self, wanted: Mapping[str, float], feedback: Feedback, gain: float) -> PadMove:
        """Return what the hand does, by what it sees. `gain`: 1/s, of the speed by the distance."""
        move = PadMove()
        here, there = by_name(self._description, feedback.axes), by_name(self._description, feedback.goals)
        ways = {name: goal - (here[name] if name != "gripper" else there[name] or 0.0) for name, goal in wanted.items()}
        self._pushed = set()
        shares: dict[str, float] = {}  # of full speed, by the pad's part
        crosses: dict[str, tuple[str, float]] = {}
        for binding in self._description.layers[0].bindings:
            name = binding.axis
            pad: str = binding.pad or ""
            if name not in ways or self._is_stuck(name):
                continue
            way = ways[name] / binding.scale * (-1 if binding.invert_pad else 1)
            if pad in DPAD:
                crosses[pad] = name, way
            elif abs(way) > CLOSE[self._axes[name].unit]:
                shares[pad] = self._share(way, gain, self._axes[name])
                self._push(name)
        self._press_cross(move, crosses, max(map(abs, shares.values()), default=0.0))
        for pad, share in shares.items():
            moved = deflection(share / SLOW_SHARE if move.slow else share)
            if pad in STICKS:
                move.sticks[STICKS[pad]] = moved
            else:
                move.triggers[RIGHT_TRIGGER if moved > 0 else LEFT_TRIGGER] = abs(moved)
        return move

    def _press_cross(self, move: PadMove, crosses: Mapping[str, tuple[str, float]], fastest: float) -> None:
        """Press the cross for what is far; for what is near, slowly, once the sticks ask for little (`fastest`) too."""
        far = {pad: each for pad, each in crosses.items() if abs(each[1]) > FAR_TURN}
        near = {pad: each for pad, each in crosses.items() if abs(each[1]) > NEAR_TURN}
        chosen = far or (near if fastest < SLOW_ENOUGH else {})
        move.slow = bool(chosen) and not far
        for pad, (name, way) in chosen.items():
            move.pressed.add(DPAD[pad][way > 0])
            self._push(name)

    def _push(self, name: str) -> None:
        self._pushed.add(name)

    def _watch(self, here: Mapping[str, float]) -> None:
        """Count the feedbacks in which the tool is pushed and neither turns nor moves."""
        for name in ROTATION:
            stood = name in self._pushed and abs(here[name] - self._before.get(name, math.inf)) < STANDS
            if name in self._pushed:
                self._stood[name] = self._stood.get(name, 0) + 1 if stood else 0
        for name in POSITION:
            waits = name in self._pushed and abs(here[name] - self._before.get(name, math.inf)) < MOVES
            self._waited[name] = self._waited.get(name, 0) + 1 if waits else 0
        self._before = {name: here[name] for name in (*POSITION, *ROTATION)}

    def _is_stuck(self, name: str) -> bool:
        return self._stood.get(name, 0) >= PATIENCE

    def _share(self, way: float, gain: float, axis: Axis) -> float:
        """Return the share of full speed: the more, the further it is, and the longer nothing has moved."""
        share = min(max(gain * way / axis.slew, -1.0), 1.0)
        harder = share * 2.0 ** (self._waited.get(axis.name, 0) // HARDER)
        return math.copysign(max(abs(share), min(abs(harder), HARDEST)), share)
