"""A robot with goal axes for tests: it hangs below its goals, and its tool is driven in place of its joints."""

import asyncio
from collections.abc import Callable, Sequence

import msgspec

from lockstep.protocol.description import Axis, Body, Pose, RobotDescription
from lockstep.robot_bridge.robots.base import Measurement, Robot
from tests.waiting import PATIENCE

__all__ = ["ARM_AXES", "BASE", "ELBOW", "SHOULDER", "TURN", "HangingArm", "X", "Z"]

SHOULDER = Axis(
    name="shoulder",
    label="Shoulder",
    unit="rad",
    minimum=-2,
    maximum=2,
    slew=1.5,
    brake=15,
    acceleration=6,
    kind="goal",
    reach=0.5,
)
ELBOW = msgspec.structs.replace(SHOULDER, name="elbow", label="Elbow")
TURN = msgspec.structs.replace(
    SHOULDER, name="turn", label="Turn", minimum=-3.2, maximum=3.2, wrap=6.283185307179586, reach=1.0
)
X = msgspec.structs.replace(SHOULDER, name="x", label="Tool x", unit="m")
Z = msgspec.structs.replace(SHOULDER, name="z", label="Tool z", unit="m")
BASE = Axis(name="base", label="Base", unit="m/s", minimum=-1, maximum=1, slew=4, brake=10)
ARM_AXES = (BASE, SHOULDER, ELBOW, TURN, X, Z)


class HangingArm(Robot):
    """Two joints whose sum and difference are the tool's x and z, a turning wrist, and a base.

    It is measured `sag` below its goals, which a servo without an integral part does under a load.
    """

    def __init__(self, sag: float = 0.0, falls: float = 0.0) -> None:
        """`falls`: how far the joints fall when the robot's own stop cuts their power; 0: it holds them."""
        self.sag = sag
        self._falls = falls
        self.applied: list[list[float]] = []
        self.calls: list[str] = []
        self.pursued = [0.0, 0.2, 0.4, 0.0, 0.6, -0.2]
        self.known = True
        self._ticked = asyncio.Event()

    def describe(self) -> RobotDescription:
        return RobotDescription(
            name="arm",
            label="Arm",
            axes=ARM_AXES,
            bodies=(Body(name="tool", parent=""),),
            poses=(
                Pose(
                    name="tool",
                    label="Tool",
                    body="tool",
                    position=("x", "", "z"),
                    instead_of=("shoulder", "elbow"),
                ),
            ),
            max_event_rate=200,
            watchdog=0.28,  # the machine that runs the tests may hold up the ticks
        )

    def apply(self, values: Sequence[float]) -> None:
        before = self.applied[-1] if self.applied else self.pursued
        self.applied.append(list(values))
        base, shoulder, elbow, turn, x, z = values
        if (x, z) != (before[4], before[5]):  # the tool is driven
            shoulder, elbow = (x + z) / 2, (x - z) / 2
        elif (shoulder, elbow) == (before[1], before[2]):
            shoulder, elbow = self.pursued[1:3]
        self.pursued = [base, shoulder, elbow, turn, shoulder + elbow, shoulder - elbow]
        self._ticked.set()

    async def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait until the condition holds after a tick."""
        try:
            async with asyncio.timeout(PATIENCE):
                while not condition():
                    self._ticked.clear()
                    await self._ticked.wait()
        except TimeoutError:
            raise AssertionError(f"never happened: {what}") from None

    def goals(self) -> Sequence[float]:
        return self.pursued

    def measured_axes(self) -> Sequence[float]:
        if not self.known:
            return [float("nan")] * len(ARM_AXES)
        base, shoulder, elbow, turn, _, _ = self.pursued
        shoulder, elbow = shoulder - self.sag, elbow - self.sag
        return [base, shoulder, elbow, turn, shoulder + elbow, shoulder - elbow]

    def measure(self) -> Measurement:
        return Measurement(axes=list(self.measured_axes()), joints=[], wrench=[], ranges=[], at_rest=True, faults=[])

    def stop(self) -> None:
        self.calls.append("stop")
        if self._falls:
            self.sag = self._falls

    def reset(self) -> None:
        self.calls.append("reset")
        if self._falls:
            self.pursued, self.sag = list(self.measured_axes()), 0.0
