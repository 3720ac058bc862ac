"""A leader arm and a policy put a block into the bowl: they drive the joints, where the script drives the tool."""

from collections.abc import Iterator

import pytest

from lockstep.bench.pick_place.hands import LEADER_SCALES, LeaderHand, PolicyHand
from lockstep.bench.pick_place.script import PickAndPlace
from lockstep.client import Clutch
from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE, arm_file
from lockstep.robot_bridge.robots.so101.robot import So101
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER, ArmDriver

EVENTS = 2000
CLUTCHED = 60  # events, after which the leader lets go once


@pytest.fixture
def arm() -> Iterator[ArmDriver]:
    if not (MODEL_FOLDER / ".installed").is_file():
        pytest.skip("the model of the SO-101 is not here; `make test` fetches it")
    try:
        robot = So101(arm_file({FOLDER_VARIABLE: str(MODEL_FOLDER)}))
    except RobotUnavailable as error:
        pytest.skip(str(error))
    yield ArmDriver(robot)
    robot.close()


def test_a_policy_that_puts_out_joint_positions_puts_a_block_into_the_bowl(arm: ArmDriver) -> None:
    task, feedback = PickAndPlace(arm.description, "green", PolicyHand(arm.description)), arm.feedback
    for _ in range(EVENTS):
        if task.done or task.failed:
            break
        feedback = arm.command(task.values(feedback))
    assert task.done, task.failed
    assert arm.reached
    assert arm.robot.simulation.blocks_in_bowl() == 1


def test_a_leader_whose_joints_are_mirrored_does_too_and_may_let_go_in_mid_motion(arm: ArmDriver) -> None:
    hand = LeaderHand(arm.description, Clutch(arm.description, LEADER_SCALES))
    task, feedback = PickAndPlace(arm.description, "blue", hand), arm.feedback
    for event in range(EVENTS):
        if task.done or task.failed:
            break
        if event == CLUTCHED:
            hand.clutch.release()
        hand.clutch.observe(feedback)
        feedback = arm.command(task.values(feedback))
        assert not hand.clutch.clipped
    assert task.done, task.failed
    assert hand.engagements == 2
    assert arm.reached
    assert arm.robot.simulation.blocks_in_bowl() == 1
