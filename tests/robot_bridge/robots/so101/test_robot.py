import math

import numpy as np
import pytest

from lockstep.bench.pick_place import PickAndPlace
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible, ActionRun
from lockstep.robot_bridge.robots.so101.robot import So101
from lockstep.robot_bridge.robots.so101.simulation import HOME
from tests.robot_bridge.robots.so101.driver import ArmDriver


def joints(arm: ArmDriver) -> list[float]:
    return list(arm.robot.positions())


def test_the_description_can_be_driven(robot: So101) -> None:
    check_description(robot.describe())


def test_at_rest_the_arm_holds_its_posture_and_its_weight(arm: ArmDriver) -> None:
    before = arm.drive(1.0)
    after = arm.drive(10.0)
    assert after.at_rest
    assert after.joints == pytest.approx(before.joints, abs=1e-3)
    assert after.joints == pytest.approx(HOME, abs=0.01)


@pytest.mark.parametrize("name", ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"])
def test_a_joint_goes_to_its_goal_and_no_other_joint_moves(arm: ArmDriver, name: str) -> None:
    before = joints(arm)
    goal = arm.value(name) - 0.2
    after = arm.drive(1.5, **{name: goal}).joints
    for joint, (old, new) in zip(arm.description.joints, zip(before, after, strict=True), strict=True):
        assert new == pytest.approx(goal if joint.name == name else old, abs=0.015)


@pytest.mark.parametrize(("axis", "way"), [("tool.x", 0.04), ("tool.y", 0.06), ("tool.z", 0.05), ("tool.y", -0.06)])
def test_the_tool_goes_along_an_axis_in_a_straight_line(arm: ArmDriver, axis: str, way: float) -> None:
    begun = [arm.value(name) for name in ("tool.x", "tool.y", "tool.z")]
    number = ("tool.x", "tool.y", "tool.z").index(axis)
    for _ in range(40):
        arm.command({axis: begun[number] + way})
        others = [
            arm.value(name) - begun[index] for index, name in enumerate(("tool.x", "tool.y", "tool.z")) if name != axis
        ]
        assert np.abs(others).max() < 0.008
    assert arm.value(axis) == pytest.approx(begun[number] + way, abs=0.003)


def test_when_the_tool_is_driven_after_the_joints_it_begins_where_they_brought_it(arm: ArmDriver) -> None:
    arm.drive(1.2, shoulder_pan=0.4, elbow_flex=0.6)
    before = joints(arm)
    here = {name: goal for name, goal in zip(arm.names, arm.feedback.goals, strict=True) if name.startswith("tool.")}
    arm.command(here)
    arm.drive(0.5)
    assert joints(arm) == pytest.approx(before, abs=0.003)
    arm.drive(1.0, tool_z=arm.value("tool.z") + 0.04)
    after = arm.feedback.goals
    arm.command({"shoulder_pan": after[0], "wrist_flex": after[3]})
    arm.drive(0.5)
    assert joints(arm)[:5] == pytest.approx(after[:5], abs=0.02)


def test_a_tool_goal_that_stands_still_ends_all_motion_soon_even_out_of_reach(arm: ArmDriver) -> None:
    """At the edge of its reach, with the goal 10 cm ahead of the tool: within `hold` of the goal the arm is at rest."""
    for _ in range(80):
        arm.command({"tool.x": arm.value("tool.x") + 0.09, "tool.z": arm.value("tool.z") + 0.04})
    arm.ticks(arm.description.hold + 0.3)
    rest = arm.robot.goals()
    arm.drive(1.0)
    assert arm.robot.goals() == rest
    assert arm.feedback.at_rest


def test_the_tools_rotation_goes_as_far_as_five_joints_can_turn_it(arm: ArmDriver) -> None:
    place = [arm.value(name) for name in ("tool.x", "tool.y", "tool.z")]
    arm.drive(3.0, **{"tool_rz": arm.value("tool.rz") + 1.0})
    assert [arm.value(name) for name in ("tool.x", "tool.y", "tool.z")] == pytest.approx(place, abs=0.01)


def test_a_gripper_on_a_block_presses_no_harder_than_its_torque(arm: ArmDriver) -> None:
    arm.drive(1.0, gripper=-0.17)
    status = {item.name: item.value for item in arm.robot.status()}
    assert isinstance(status["grip"], float)
    assert status["grip"] <= 13.0


def test_pressing_on_the_table_is_felt_and_bounded(arm: ArmDriver) -> None:
    for _ in range(100):
        arm.command({"tool.x": 0.22, "tool.y": -0.2, "tool.z": max(0.03, arm.value("tool.z") - 0.05)})
    for _ in range(50):
        wrench = arm.command({"tool.z": 0.0}).wrench
    assert math.hypot(*wrench[:3]) < 40.0


def test_a_stopped_arm_stands_whatever_is_applied_until_it_is_reset(arm: ArmDriver) -> None:
    robot = arm.robot
    arm.drive(0.4, shoulder_pan=0.5)
    robot.stop()
    robot.stop()
    arm.drive(0.5)
    before = joints(arm)
    for number in range(100):
        robot.apply([0.01 * number] * len(arm.names))
        robot.tick()
    assert joints(arm) == pytest.approx(before, abs=2e-3)
    with pytest.raises(ActionNotPossible):
        robot.begin_action("home", {})
    arm.reset()
    arm.drive(0.5)
    assert joints(arm) == pytest.approx(before, abs=5e-3)
    arm.drive(1.0, shoulder_pan=-0.2)
    assert joints(arm)[0] == pytest.approx(-0.2, abs=0.02)


def test_goals_from_a_thread_that_rests_the_arm_keep_it_where_it_is(arm: ArmDriver) -> None:
    arm.drive(0.3, shoulder_pan=0.5)
    arm.robot.rest_from_thread()
    arm.robot.tick()
    goals = list(arm.robot.goals())
    for _ in range(100):
        arm.robot.tick()
    assert list(arm.robot.goals()) == goals


@pytest.mark.parametrize(("name", "text"), [("home", "home"), ("fold", "folded"), ("open_gripper", "open")])
def test_an_action_takes_the_arm_there(arm: ArmDriver, name: str, text: str) -> None:
    arm.drive(1.0, shoulder_pan=0.4, wrist_flex=1.2, gripper=0.1)
    run = arm.robot.begin_action(name, {})
    for _ in range(400):
        step = run.step()
        if step.done:
            break
        assert step.values is not None
        arm.command(list(step.values))
    assert step.done
    assert text in step.text
    arm.drive(0.5)
    assert arm.feedback.at_rest


def test_an_action_whose_way_is_blocked_fails(arm: ArmDriver) -> None:
    run = arm.robot.begin_action("fold", {})
    with pytest.raises(ActionFailed, match="in the way"):
        steps(run, 1000)  # nothing moves the arm


def steps(run: ActionRun, count: int) -> None:
    for _ in range(count):
        run.step()


def test_resetting_the_scene_puts_the_blocks_back_and_moves_no_arm(arm: ArmDriver) -> None:
    simulation = arm.robot.simulation
    begun, before = simulation.place("red_block"), joints(arm)
    simulation.data.qpos[0:3] = (0.3, 0.2, 0.3)
    arm.drive(0.5)
    assert simulation.place("red_block") != pytest.approx(begun, abs=0.05)
    run = arm.robot.begin_action("reset_scene", {})
    assert run.step().done
    assert simulation.place("red_block") == pytest.approx(begun, abs=1e-6)
    assert joints(arm) == pytest.approx(before, abs=2e-3)


def test_a_simulation_that_diverged_begins_anew_and_says_so(arm: ArmDriver) -> None:
    arm.ticks(0.04)
    arm.robot.simulation.data.qvel[:] = math.nan
    arm.ticks(0.04)
    assert arm.robot.simulation.restarts == 1
    assert "diverged" in arm.feedback.faults[0]
    assert joints(arm) == pytest.approx(HOME, abs=0.02)


def test_after_a_simulation_began_anew_a_joint_is_driven_from_where_it_is_then(arm: ArmDriver) -> None:
    arm.drive(1.0, shoulder_pan=0.4)
    arm.ticks(0.6)
    assert arm.feedback.goals[0] == pytest.approx(0.4)
    arm.robot.simulation.data.qvel[:] = math.nan
    arm.ticks(0.04)
    goal = arm.feedback.goals[0]
    assert goal is not None
    assert goal == pytest.approx(HOME[0], abs=1e-6)
    arm.drive(0.4, shoulder_pan=goal + 0.01)
    assert joints(arm) == pytest.approx(HOME, abs=0.02)


def test_a_grip_outlives_a_stop_and_its_reset(arm: ArmDriver) -> None:
    simulation = arm.robot.simulation
    task = PickAndPlace(arm.description, "red")
    feedback = arm.feedback
    while simulation.place("red_block")[2] < 0.1:
        feedback = arm.command(task.values(feedback))
    arm.robot.stop()
    arm.drive(1.0)
    arm.reset()
    arm.drive(1.0)
    assert simulation.place("red_block")[2] > 0.09
