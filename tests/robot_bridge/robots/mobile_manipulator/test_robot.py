import math

import numpy as np
import pytest

from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator
from tests.robot_bridge.robots.mobile_manipulator.driver import Driver

INNER_WALLS = ((-2.5, 3.5), (-2.7, 2.7))  # m, in x and y
DRUM = 0.31  # m


def test_driving_forward_moves_along_the_base_frame_after_a_turn(driver: Driver) -> None:
    driver.run(math.pi / 2, base_wz=1.0)
    driver.run(0.3)
    before = driver.robot.measure().joints
    measured = driver.run(1.0, base_vx=0.4)
    after = measured.joints
    travelled = np.array(after[:2]) - before[:2]
    heading = np.array((math.cos(after[2]), math.sin(after[2])))
    assert abs(before[2] - math.pi / 2) < 0.1
    assert travelled @ heading == pytest.approx(0.4, abs=0.04)
    assert abs(np.cross((*heading, 0.0), (*travelled, 0.0))[2]) < 0.02
    assert measured.axes[:3] == pytest.approx([0.4, 0.0, 0.0], abs=0.02)


def test_driving_left_moves_to_positive_y(driver: Driver) -> None:
    measured = driver.run(1.0, base_vy=0.3)
    assert measured.joints[1] == pytest.approx(0.3, abs=0.03)
    assert abs(measured.joints[0]) < 0.02


@pytest.mark.parametrize(("axis", "index"), [("tool_vx", 0), ("tool_vy", 1), ("tool_vz", 2)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tool_velocity_moves_the_tool_in_that_direction_of_the_turned_base(
    driver: Driver, axis: str, index: int, sign: float
) -> None:
    driver.run(1.0, base_wz=1.0)
    driver.run(1.0, tool_vz=0.2)
    driver.run(0.4)
    before = driver.tool()
    measured = driver.run(1.0, **{axis: 0.1 * sign})
    moved = driver.tool() - before
    wanted = np.zeros(3)
    wanted[index] = 0.1 * sign
    assert moved == pytest.approx(wanted, abs=0.01)
    assert measured.axes[3 + index] == pytest.approx(0.1 * sign, abs=0.01)


@pytest.mark.parametrize(("axis", "index"), [("tool_wx", 0), ("tool_wy", 1), ("tool_wz", 2)])
def test_a_tool_turn_turns_the_tool_about_that_axis_and_leaves_its_tip_in_place(
    driver: Driver, axis: str, index: int
) -> None:
    before = driver.data.body("tool").xmat.reshape(3, 3).copy()
    tip = driver.tool()
    driver.run(1.0, **{axis: 0.4})
    turned = driver.data.body("tool").xmat.reshape(3, 3) @ before.T
    turn = np.array((turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1])) / 2
    wanted = np.zeros(3)
    wanted[index] = math.sin(0.4)
    assert turn == pytest.approx(wanted, abs=0.05)
    assert driver.tool() == pytest.approx(tip, abs=0.012)


def test_at_rest_neither_arm_nor_base_drift(driver: Driver) -> None:
    driver.run(0.8, base_vx=0.3, tool_vz=0.1)
    before = driver.run(1.0)
    after = driver.run(20.0)
    assert before.at_rest
    assert after.at_rest
    assert after.joints == pytest.approx(before.joints, abs=1e-4)


def test_a_resting_base_that_is_pushed_stays_where_it_is(driver: Driver) -> None:
    driver.run(0.5, base_vx=0.2)
    before = driver.run(1.0).joints
    base = driver.robot.simulation.model.body("base").id
    driver.data.xfrc_applied[base, :2] = (60.0, -40.0)  # N, as hard as the arm can push
    measured = driver.run(5.0)
    assert measured.joints[:3] == pytest.approx(before[:3], abs=0.005)
    assert measured.at_rest


def test_from_full_speed_the_robot_is_at_rest_soon(driver: Driver) -> None:
    assert not driver.run(1.0, base_vx=0.6, base_wz=0.5, tool_vz=0.2).at_rest
    assert driver.run(0.6).at_rest


@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_a_base_driven_into_a_wall_feels_a_force_against_its_motion(driver: Driver, turn: float) -> None:
    if turn:
        driver.run(math.pi, base_wz=turn)
    direction = -1.0 if not turn else 1.0
    measured = driver.run(4.4, base_vx=0.6 * direction)
    assert abs(measured.axes[0]) < 0.02
    assert measured.wrench[0] * direction < -100.0
    assert abs(measured.wrench[1]) < 0.1 * abs(measured.wrench[0])
    assert driver.run(1.0).wrench[0] == pytest.approx(0.0, abs=10.0)
    assert driver.run(1.0, base_vx=-0.4 * direction).wrench == [0.0] * 6


def test_without_contact_the_wrench_is_nought_however_the_robot_moves(driver: Driver) -> None:
    for axes in ({"base_wz": 1.0}, {"tool_vz": 0.2}, {"base_vx": -0.5, "tool_wy": -1.0}):
        assert driver.run(0.5, **axes).wrench == [0.0] * 6


def test_pushing_an_object_moves_it_and_is_felt(driver: Driver) -> None:
    can = driver.place("green_can")
    felt = []
    for _ in range(40):
        felt.append(driver.run(0.1, base_vx=0.2).wrench)
    assert driver.place("green_can")[0] > can[0] + 0.1
    strongest = min(felt)
    assert strongest[0] < -2.0  # against the push
    assert abs(strongest[1]) < abs(strongest[0])


def test_pressing_the_tool_on_the_table_is_felt_upwards_and_bounded(driver: Driver) -> None:
    driver.run(2.0, base_vx=0.3)
    driver.run(0.5, tool_vz=0.2)
    driver.run(0.5)
    measured = driver.run(4.0, tool_vz=-0.1)
    assert 10.0 < measured.wrench[2] < 300.0
    assert driver.run(1.5, tool_vz=0.1).wrench == [0.0] * 6  # nothing stored up: it comes off at once


def test_an_arm_at_its_end_says_so_and_stays_within_its_joint_limits(driver: Driver) -> None:
    measured = driver.run(5.0, tool_vx=-0.25)
    assert measured.faults
    joints = driver.robot.describe().joints[3:]
    for joint, value in zip(joints, measured.joints[3:], strict=True):
        if joint.minimum is None or joint.maximum is None:
            raise TypeError(joint)
        assert joint.minimum - 0.05 < value < joint.maximum + 0.05
    assert driver.run(0.5).faults == []


def test_one_robot_sized_room_is_measured_as_the_description_says(robot: MobileManipulator) -> None:
    description, measured = robot.describe(), robot.measure()
    if description.ranges is None:
        raise TypeError(description)
    assert len(measured.axes) == len(description.axes) == 9
    assert len(measured.joints) == len(description.joints)
    assert len(measured.wrench) == 6
    assert len(measured.ranges) == description.ranges.count
    model = robot.simulation.model
    assert [joint.name for joint in description.joints] == [model.joint(index).name for index in range(9)]
    assert all(value == round(value, 5) for value in measured.joints + measured.axes + measured.ranges)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ten_seconds_of_extreme_random_commands_break_nothing(robot: MobileManipulator, seed: int) -> None:
    random = np.random.default_rng(seed)
    limits = np.array([axis.maximum for axis in robot.describe().axes])
    for _ in range(50):
        values = limits * random.choice((-1.0, 0.0, 1.0), len(limits))
        for _ in range(50):
            robot.apply(values.tolist())
            robot.tick()
        measured = robot.measure()
        assert np.isfinite([*measured.axes, *measured.joints, *measured.wrench, *measured.ranges]).all()
        for value, (lower, upper) in zip(measured.joints, INNER_WALLS, strict=False):
            assert lower + DRUM - 0.05 < value < upper - DRUM + 0.05
    assert robot.simulation.restarts == 0


def test_a_diverged_simulation_is_restarted_and_reported(driver: Driver) -> None:
    driver.run(0.5, base_vx=0.5)
    driver.data.qvel[0] = math.nan
    measured = driver.run(0.1)
    assert any("diverged" in fault for fault in measured.faults)
    assert np.isfinite(measured.joints).all()
    assert driver.run(0.5, base_vx=0.5).joints[0] == pytest.approx(0.25, abs=0.05)


def test_closing_twice_is_harmless(robot: MobileManipulator) -> None:
    robot.close()
    robot.close()
