"""The arm's drive: when a twist is resolved anew."""

import math

import mujoco
import pytest

from lockstep.robot_bridge.robots.mobile_manipulator.arm_drive import STEADY, ArmDrive
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import ARM, Simulation

UP = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
DOWN = tuple(-speed for speed in UP)


def move(simulation: Simulation, joint: int, angle: float) -> None:
    simulation.data.qpos[ARM][joint] += angle
    mujoco.mj_forward(simulation.model, simulation.data)


def test_an_arm_that_hardly_moved_makes_the_same_of_a_twist_to_within_a_hundredth() -> None:
    simulation = Simulation()
    drive = ArmDrive(simulation)
    known = drive.rates(UP)
    for joint in range(6):
        move(simulation, joint, 0.9 * STEADY)
    assert drive.rates(UP) is known
    anew = ArmDrive(simulation).rates(UP)
    assert anew != known
    assert math.dist(anew, known) < 0.01 * math.hypot(*anew)


@pytest.mark.parametrize("joint", range(6))
def test_a_twist_is_resolved_anew_when_any_joint_has_moved(joint: int) -> None:
    simulation = Simulation()
    drive = ArmDrive(simulation)
    drive.rates(UP)
    move(simulation, joint, 1.1 * STEADY)
    assert drive.rates(UP) == ArmDrive(simulation).rates(UP)


def test_another_twist_is_resolved_by_itself() -> None:
    simulation = Simulation()
    drive = ArmDrive(simulation)
    up = drive.rates(UP)
    assert drive.rates(DOWN) == pytest.approx([-rate for rate in up], abs=1e-6)
