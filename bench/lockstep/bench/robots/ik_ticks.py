"""`python -m lockstep.bench.robots.ik_ticks ROBOT`: the processor time of ticks in which a tool is driven.

Prints the ms of each tick until its feedback can be sent, and of what is computed ahead after it, as JSON.
"""

import json
import math
import sys
import time
from typing import NamedTuple

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.registry import create_robot

__all__ = ["TickTimes", "tick_times"]

TICKS = 3000
SWING = 0.06  # m, to and fro along y


class TickTimes(NamedTuple):
    """Processor times in ms, one for each tick."""

    until_feedback: list[float]
    ahead: list[float]  # after the feedback, for the next tick


def tick_times(robot: Robot, ticks: int = TICKS, *, driven: bool = True) -> TickTimes:
    """Measure ticks of a robot whose first pose is driven to and fro, or that rests."""
    description = robot.describe()
    pose = description.poses[0]
    number = [axis.name for axis in description.axes].index(pose.position[1])
    goals = list(robot.goals())
    values = [0.0 if goal is None else goal for goal in goals]
    begun = values[number]
    robot.apply(values)
    robot.tick()
    found = TickTimes([], [])
    for tick in range(ticks):
        if driven:
            values[number] = begun + SWING * math.sin(tick / 100)
        began = time.thread_time()
        robot.apply(values)
        robot.tick()
        fed_back = time.thread_time()
        robot.prepare()
        found.until_feedback.append(1000 * (fed_back - began))
        found.ahead.append(1000 * (time.thread_time() - fed_back))
    return found


if __name__ == "__main__":
    arm = create_robot(sys.argv[1])
    try:
        sys.stdout.write(json.dumps(tick_times(arm)._asdict()))
    finally:
        arm.close()
