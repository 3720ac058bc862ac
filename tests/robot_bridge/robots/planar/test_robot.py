import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.robots.planar.description import DESCRIPTION, RADIUS, RANGES
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot, PlanarState
from lockstep.robot_bridge.robots.planar.room import HALF_LENGTH, HALF_WIDTH, PILLARS


def drive(robot: PlanarRobot, values: list[float], seconds: float) -> None:
    for _ in range(round(seconds / robot.tick_seconds)):
        robot.apply(values)
        robot.tick()


def test_it_moves_as_commanded_in_its_own_frame() -> None:
    robot = PlanarRobot(PlanarState(yaw=math.pi / 2))
    drive(robot, [0.5, 0.0, 0.0], 1.0)
    measured = robot.measure()
    assert measured.joints == pytest.approx([0.0, 0.5, math.pi / 2])
    assert measured.axes == pytest.approx([0.5, 0.0, 0.0])
    assert not measured.at_rest


def test_it_turns_left_for_a_positive_rate() -> None:
    robot = PlanarRobot()
    drive(robot, [0.0, 0.0, 1.0], 0.5)
    assert robot.state.yaw == pytest.approx(0.5)


def test_it_is_at_rest_when_nothing_is_commanded() -> None:
    robot = PlanarRobot()
    drive(robot, [0.5, 0.2, 1.0], 0.2)
    drive(robot, [0.0, 0.0, 0.0], robot.tick_seconds * 2)
    assert robot.measure().at_rest
    assert robot.measure().axes == [0.0, 0.0, 0.0]


def test_a_wall_stops_it_and_is_felt_from_ahead() -> None:
    robot = PlanarRobot(PlanarState(x=HALF_LENGTH - RADIUS - 0.05))
    drive(robot, [0.4, 0.0, 0.0], 1.0)
    assert robot.state.x == pytest.approx(HALF_LENGTH - RADIUS)
    assert robot.measure().wrench == pytest.approx([-60.0, 0, 0, 0, 0, 0])
    assert robot.measure().axes == pytest.approx([0.0, 0.0, 0.0])
    drive(robot, [0.0, 0.0, 0.0], 0.1)
    assert robot.measure().wrench == pytest.approx([0.0] * 6)


def test_it_slides_along_a_wall() -> None:
    robot = PlanarRobot(PlanarState(x=HALF_LENGTH - RADIUS))
    drive(robot, [0.4, -0.3, 0.0], 0.5)
    assert robot.state.y == pytest.approx(-0.15)
    assert robot.state.vx == pytest.approx(0.0)


def test_the_force_is_told_in_its_own_frame() -> None:
    robot = PlanarRobot(PlanarState(x=HALF_LENGTH - RADIUS, yaw=math.pi / 2))
    drive(robot, [0.0, -0.4, 0.0], 0.1)
    fx, fy, *_ = robot.measure().wrench
    assert (fx, fy) == pytest.approx((0.0, 60.0))


@given(
    st.floats(-math.pi, math.pi),
    st.lists(st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(-1.5, 1.5)), min_size=1, max_size=6),
)
def test_it_never_leaves_the_room_nor_enters_a_pillar(yaw: float, commands: list[tuple[float, float, float]]) -> None:
    robot = PlanarRobot(PlanarState(yaw=yaw))
    for command in commands:
        drive(robot, list(command), 1.5)
        x, y = robot.state.x, robot.state.y
        assert abs(x) <= HALF_LENGTH - RADIUS + 1e-2
        assert abs(y) <= HALF_WIDTH - RADIUS + 1e-2
        for px, py, radius in PILLARS.tolist():
            assert math.hypot(x - px, y - py) >= radius + RADIUS - 1e-2


def test_the_rays_go_round_from_behind_and_see_the_walls() -> None:
    ranges = PlanarRobot(PlanarState(x=0.0, y=-2.5)).measure().ranges
    assert len(ranges) == RANGES.count
    assert ranges[RANGES.count // 4] == pytest.approx(0.5)  # to the right
    assert ranges[RANGES.count // 2] == pytest.approx(4.0)  # ahead
    assert ranges[RANGES.count * 3 // 4] == RANGES.range_max  # the left wall is out of reach


def test_a_ray_sees_the_pillar_before_the_wall() -> None:
    x, y, radius = PILLARS[0].tolist()
    ranges = PlanarRobot(PlanarState(x=x - 1.0, y=y)).measure().ranges
    assert ranges[RANGES.count // 2] == pytest.approx(1.0 - radius)


def test_its_measurement_has_the_shape_of_its_description() -> None:
    robot = PlanarRobot()
    measured = robot.measure()
    assert robot.describe() is DESCRIPTION
    assert len(measured.axes) == len(DESCRIPTION.axes)
    assert len(measured.joints) == len(DESCRIPTION.joints)
    assert len(measured.wrench) == 6
    bound = {binding.axis for layer in DESCRIPTION.layers for binding in layer.bindings}
    assert bound == {axis.name for axis in DESCRIPTION.axes}
