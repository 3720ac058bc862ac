"""Measures the inverse kinematics: processor time of a tick of the robot, before and after its feedback can be sent.

python -m scripts.ik_cost             the SO-101; needs its model: lockstep robot fetch so101
python -m scripts.ik_cost MODEL.xml   a MuJoCo model that names a tool (docs/mujoco.md)
"""

import math
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lockstep.bench.robots.ik_ticks import TickTimes, tick_times
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.robots.so101.reach import arm_chain, arm_solver
from lockstep.robot_bridge.robots.so101.simulation import HOME

STEPS = 3000
SWING = 0.06  # m, to and fro along y


def show(what: str, times: Sequence[float]) -> None:
    """Print processor times, in µs."""
    median, late = statistics.median(times), statistics.quantiles(times, n=100)[-1]
    print(f"{what:44}{median:6.0f} µs, 99 % below {late:6.0f} µs")


def measure(robot: Robot) -> None:
    description = robot.describe()
    print(f"{description.label}: {len(description.poses[0].instead_of)} joints")
    tell("one tick, tool driven", tick_times(robot, STEPS))
    tick_times(robot, 100, driven=False)  # it comes to rest
    tell("one tick, at rest", tick_times(robot, STEPS, driven=False))


def tell(what: str, times: TickTimes) -> None:
    for part, found in zip(("", ", after the feedback"), times, strict=True):
        show(what + part, [1000 * each for each in found])


def measure_solver(robot: Robot) -> None:
    """Measure a step of the SO-101's solver alone."""
    chain = arm_chain(robot.describe())
    solver, joints = arm_solver(robot.describe(), chain), HOME[:5]
    begun = chain.at(joints)

    times = []
    for step in range(STEPS):
        goal = begun.position + np.array((0.0, SWING * math.sin(step / 100), 0.0))
        before = time.thread_time()
        joints = solver.step(joints, goal, begun.rotation, robot.tick_seconds).joints
        times.append(1e6 * (time.thread_time() - before))
    show("one step of the solver", times)


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
