"""Measures the inverse kinematics: processor time of a step of the solver, and of a tick of the robot.

python -m scripts.ik_cost             the SO-101; needs its model: lockstep robot fetch so101
python -m scripts.ik_cost MODEL.xml   a MuJoCo model that names a tool (docs/mujoco.md)
"""

import math
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.robots.so101.reach import arm_chain, arm_solver
from lockstep.robot_bridge.robots.so101.simulation import HOME

STEPS = 3000
SWING = 0.06  # m, to and fro along y


def times_us(call: Callable[[int], object]) -> tuple[float, float]:
    """Return the median and the 99th percentile of the processor time of one call, µs."""
    spent = []
    for number in range(STEPS):
        before = time.thread_time()
        call(number)
        spent.append(1e6 * (time.thread_time() - before))
    return statistics.median(spent), statistics.quantiles(spent, n=100)[-1]


def show(what: str, times: tuple[float, float]) -> None:
    median, late = times
    print(f"{what:26}{median:6.0f} µs, 99 % below {late:6.0f} µs")


def measure(robot: Robot) -> None:
    description = robot.describe()
    pose = description.poses[0]
    number = [axis.name for axis in description.axes].index(pose.position[1])
    values = list(robot.goals())
    begun = values[number]
    robot.apply(values)
    robot.tick()

    def drive(step: int) -> None:
        values[number] = begun + SWING * math.sin(step / 100)
        robot.apply(values)
        robot.tick()

    def rest(step: int) -> None:
        robot.apply(values)
        robot.tick()

    print(f"{description.label}: {len(pose.instead_of)} joints")
    show("one tick, tool driven", times_us(drive))
    for _ in range(100):
        rest(0)
    show("one tick, at rest", times_us(rest))


def measure_solver(robot: Robot) -> None:
    """Measure a step of the SO-101's solver alone."""
    chain = arm_chain(robot.describe())
    solver, joints = arm_solver(robot.describe(), chain), HOME[:5]
    begun = chain.at(joints)

    def solve(step: int) -> None:
        nonlocal joints
        goal = begun.position + np.array((0.0, SWING * math.sin(step / 100), 0.0))
        joints = solver.step(joints, goal, begun.rotation, robot.tick_seconds).joints

    show("one step of the solver", times_us(solve))


def main() -> None:
    is_so101 = len(sys.argv) < 2
    robot = create_robot("so101") if is_so101 else create(Path(sys.argv[1]))
    try:
        measure(robot)
        if is_so101:
            measure_solver(robot)
    finally:
        robot.close()


if __name__ == "__main__":
    main()
