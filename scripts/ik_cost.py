"""Measures the inverse kinematics: processor time of a tick of the robot, before and after its feedback can be sent.

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


def show(what: str, *calls: Callable[[int], object]) -> None:
    """Print the processor time of each of the calls, which follow each other."""
    spent: list[list[float]] = [[] for _ in calls]
    for number in range(STEPS):
        for times, call in zip(spent, calls, strict=True):
            before = time.thread_time()
            call(number)
            times.append(1e6 * (time.thread_time() - before))
    for times, part in zip(spent, ("", ", after the feedback"), strict=False):
        median, late = statistics.median(times), statistics.quantiles(times, n=100)[-1]
        print(f"{what + part:44}{median:6.0f} µs, 99 % below {late:6.0f} µs")


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
    show("one tick, tool driven", drive, lambda _: robot.prepare())
    for _ in range(100):
        rest(0)
    show("one tick, at rest", rest, lambda _: robot.prepare())


def measure_solver(robot: Robot) -> None:
    """Measure a step of the SO-101's solver alone."""
    chain = arm_chain(robot.describe())
    solver, joints = arm_solver(robot.describe(), chain), HOME[:5]
    begun = chain.at(joints)

    def solve(step: int) -> None:
        nonlocal joints
        goal = begun.position + np.array((0.0, SWING * math.sin(step / 100), 0.0))
        joints = solver.step(joints, goal, begun.rotation, robot.tick_seconds).joints

    show("one step of the solver", solve)


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
