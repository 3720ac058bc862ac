"""Measures the inverse kinematics of the SO-101: processor time of a step of the solver, and of a tick of the arm.

Needs the arm's model: lockstep robot fetch so101.
"""

import math
import statistics
import time
from collections.abc import Callable

import numpy as np

from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.robots.so101.reach import arm_chain, arm_solver
from lockstep.robot_bridge.robots.so101.simulation import HOME

STEPS = 3000


def median_us(call: Callable[[int], object]) -> float:
    """Return the median of the processor time of one call, µs."""
    spent = []
    for number in range(STEPS):
        before = time.thread_time()
        call(number)
        spent.append(time.thread_time() - before)
    return 1e6 * statistics.median(spent)


def main() -> None:
    robot = create_robot("so101")
    description, seconds = robot.describe(), robot.tick_seconds
    chain = arm_chain(description)
    solver, joints = arm_solver(description, chain), HOME[:5]
    begun = chain.at(joints)
    values = list(robot.measured_axes())
    robot.apply(values)

    def solve(number: int) -> None:
        nonlocal joints
        goal = begun.position + np.array((0.0, 0.06 * math.sin(number / 100), 0.0))
        joints = solver.step(joints, goal, begun.rotation, seconds).joints

    def tick(number: int) -> None:
        values[7] = begun.position[1] + 0.06 * math.sin(number / 100)  # tool.y
        robot.apply(values)
        robot.tick()

    print(f"one step of the solver    {median_us(solve):6.0f} µs")
    print(f"one tick, tool driven     {median_us(tick):6.0f} µs")
    print(f"one tick, at rest         {median_us(lambda number: robot.tick()):6.0f} µs")
    robot.close()


if __name__ == "__main__":
    main()
