"""A leader arm and a policy put a block into the bowl: they drive the joints, where the script drives the tool."""

from collections.abc import Iterator, Mapping

import pytest

from lockstep.bench.pick_place.hands import LEADER_SCALES, LeaderHand, PolicyHand
from lockstep.bench.pick_place.motions import BLOCKS
from lockstep.bench.pick_place.script import PickAndPlace, ToolHand
from lockstep.client import Clutch
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.so101.controls import AXES, LAYERS
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE, arm_file
from lockstep.robot_bridge.robots.so101.robot import So101
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER, ArmDriver

EVENTS = 2000
CLOSES = 3  # motions, after which the fingers close about the block
LATER = 0.4  # s without a command, more than the robot goes on for
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


@pytest.mark.parametrize("kind", ["policy", "leader"])
def test_the_open_fingers_come_straight_down_and_touch_no_block_however_rarely_a_command_comes(
    arm: ArmDriver, kind: str
) -> None:
    clutch = Clutch(arm.description, LEADER_SCALES)
    hand = PolicyHand(arm.description) if kind == "policy" else LeaderHand(arm.description, clutch)
    task, feedback = PickAndPlace(arm.description, "red", hand), arm.feedback
    while task.motions_done < CLOSES and not task.failed:
        clutch.observe(feedback)
        feedback = arm.command(task.values(feedback))
        arm.ticks(LATER)
    assert not task.failed
    place = arm.robot.simulation.place("red_block")
    assert place[:2] == pytest.approx((BLOCKS["red"].x, BLOCKS["red"].y), abs=1e-3)


def test_a_hand_that_has_thought_about_a_feedback_does_not_judge_it_twice() -> None:
    class Counting(ToolHand):
        judged = 0

        def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
            self.judged += 1
            return super().applied(goals, feedback)

    robot = RobotDescription(name="so101", label="SO-101", axes=AXES, layers=LAYERS)
    places = [0.1] * len(AXES)
    feedback = Feedback(event=1, issue=1, time=1.0, axes=places, goals=[*places])
    hand = Counting(robot)
    task = PickAndPlace(robot, "red", hand)
    task.think(feedback)
    task.values(feedback)
    assert hand.judged == 1
