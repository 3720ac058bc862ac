"""A scripted operator puts blocks into the bowl: by contact, friction and gripping force of MuJoCo alone."""

import math

import pytest

from lockstep.bench.pick_place import BLOCKS, PickAndPlace
from lockstep.bench.pick_place.motions import Place
from tests.robot_bridge.robots.so101.driver import ArmDriver

EVENTS = 2000


def play(arm: ArmDriver, block: str, place: Place | None = None) -> PickAndPlace:
    task = PickAndPlace(arm.description, block, place=place)
    feedback = arm.feedback
    for _ in range(EVENTS):
        if task.done or task.failed:
            break
        feedback = arm.command(task.values(feedback))
    return task


@pytest.mark.parametrize("block", BLOCKS)
def test_a_block_is_put_into_the_bowl_within_the_axes_reach(arm: ArmDriver, block: str) -> None:
    task = play(arm, block)
    assert task.done, task.failed
    assert arm.reached
    assert arm.robot.simulation.blocks_in_bowl() == 1


def test_a_block_that_was_put_elsewhere_is_put_into_the_bowl_from_there(arm: ArmDriver) -> None:
    simulation = arm.robot.simulation
    simulation.put("red_block", (0.19, -0.11, 0.014), -0.6)
    assert simulation.turn("red_block") == pytest.approx(-0.6)
    assert simulation.place("red_block") == pytest.approx((0.19, -0.11, 0.014))
    task = play(arm, "red", Place(0.19, -0.11, -0.6))
    assert task.done, task.failed
    assert simulation.blocks_in_bowl() == 1


def test_ten_of_ten_blocks_end_in_the_bowl_three_of_them_beside_each_other(arm: ArmDriver) -> None:
    simulation = arm.robot.simulation
    for number in range(10):
        name, before = list(BLOCKS)[number % len(BLOCKS)], number % len(BLOCKS)
        if not before:
            arm.robot.begin_action("reset_scene", {})
        assert simulation.blocks_in_bowl() == before
        task = play(arm, name)
        assert task.done, (number, task.failed)
        assert simulation.blocks_in_bowl() == before + 1, (number, name)
    assert arm.reached


def test_a_held_block_falls_when_the_gripper_opens(arm: ArmDriver) -> None:
    simulation = arm.robot.simulation
    task = PickAndPlace(arm.description, "red")
    feedback = arm.feedback
    while simulation.place("red_block")[2] < 0.1:
        feedback = arm.command(task.values(feedback))
    held = feedback.wrench[:3]
    assert 0.05 < math.hypot(*held) < 1.0  # N: the block's weight is 0.2, the fingers' grip cancels
    arm.drive(0.8, gripper=0.7)
    assert simulation.place("red_block")[2] < 0.02
