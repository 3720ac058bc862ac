"""The planar robot's map, and its action that goes to a place on it."""

import math

import numpy as np
import pytest

from lockstep.protocol.maps import OCCUPIED, UNKNOWN
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible, ActionRun
from lockstep.robot_bridge.robots.planar import floor_map
from lockstep.robot_bridge.robots.planar.description import RADIUS
from lockstep.robot_bridge.robots.planar.floor_map import has_room
from lockstep.robot_bridge.robots.planar.robot import CLEARANCE, PlanarRobot, PlanarState
from lockstep.robot_bridge.robots.planar.room import CHARGER, DOCK, PILLARS

MOST = 60.0  # s of simulated time


def go(robot: PlanarRobot, x: float, y: float, yaw: float = 0.0) -> ActionRun:
    return robot.begin_action("go_to", {"x": x, "y": y, "yaw": yaw})


def drive(robot: PlanarRobot, run: ActionRun) -> list[PlanarState]:
    """Let the action run to its end, as a bridge without limits does; return the states on the way."""
    states: list[PlanarState] = []
    for _ in range(round(MOST / robot.tick_seconds)):
        step = run.step()
        if step.done:
            return states
        robot.apply([0.0 if value is None else value for value in step.values or (0.0, 0.0, 0.0)])
        robot.tick()
        states.append(robot.state)
    raise AssertionError("it does not arrive")


def test_it_goes_around_a_pillar_and_arrives_with_the_heading_that_was_asked_for() -> None:
    robot = PlanarRobot()
    check_description(robot.describe())
    states = drive(robot, go(robot, -2.9, -1.4, 2.0))  # a pillar stands in the straight way
    x, y, yaw = robot.state[:3]
    assert math.hypot(x + 2.9, y + 1.4) < 0.03
    assert abs(yaw - 2.0) < 0.05
    for px, py, radius in PILLARS.tolist():
        assert min(math.hypot(each.x - px, each.y - py) for each in states) > radius + RADIUS + CLEARANCE - 0.05


@pytest.mark.parametrize(("x", "y"), [(2.0, 1.2), (3.5, -2.6), (3.95, 0.0)], ids=["pillar", "forbidden", "wall"])
def test_a_place_without_room_is_refused(x: float, y: float) -> None:
    with pytest.raises(ActionNotPossible, match="no room"):
        go(PlanarRobot(), x, y)


def test_the_dock_has_room_and_is_beside_the_forbidden_zone() -> None:
    assert has_room(*DOCK[:2], RADIUS + CLEARANCE)
    left, _, right, high = CHARGER
    assert left + RADIUS < DOCK[0] < right - RADIUS
    assert DOCK[1] - RADIUS - high < 0.15  # m


def test_the_dock_is_told_as_the_goal_while_it_is_driven_to() -> None:
    robot = PlanarRobot()
    run = robot.begin_action("dock", {})
    assert robot.navigation().goal == DOCK
    run.cancel()
    assert robot.navigation().goal is None


def test_the_dock_is_refused_where_there_is_no_room_for_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(floor_map, "CHARGER", (2.8, -3.1, 4.1, -1.5))
    with pytest.raises(ActionNotPossible, match="no room"):
        PlanarRobot().begin_action("dock", {})


def test_it_charges_at_the_dock_alone_and_only_while_it_stands() -> None:
    x, y, yaw = DOCK
    for state, values, charges in (
        (PlanarState(x=x, y=y, yaw=yaw), [0.0, 0.0, 0.0], True),
        (PlanarState(x=x, y=y, yaw=yaw), [0.01, 0.0, 0.0], False),
        (PlanarState(x=x, y=y, yaw=yaw + 0.3), [0.0, 0.0, 0.0], False),
        (PlanarState(x=x - 0.3, y=y, yaw=yaw), [0.0, 0.0, 0.0], False),
    ):
        robot = PlanarRobot(state)
        robot.apply(values)
        robot.tick()
        before = robot._battery._share
        robot.tick()
        assert (robot._battery._share > before) == charges


def test_it_leaves_a_place_that_is_narrower_than_it_likes() -> None:
    robot = PlanarRobot(PlanarState(x=3.69, y=0.0))  # 1 cm from the wall
    drive(robot, go(robot, 1.0, -1.0))
    assert math.hypot(robot.state.x - 1.0, robot.state.y + 1.0) < 0.03


def test_goal_and_path_are_told_while_it_goes_and_not_afterwards() -> None:
    robot = PlanarRobot()
    assert (robot.navigation().goal, list(robot.navigation().path)) == (None, [])
    run = go(robot, 1.0, 0.5, 1.0)
    while not robot.navigation().path:
        run.step()
    told = robot.navigation()
    assert told.goal == (1.0, 0.5, 1.0)
    assert (told.path[0], told.path[-1]) == ((0.0, 0.0), (1.0, 0.5))
    run.cancel()
    assert robot.navigation().goal is None


def test_it_gives_up_when_it_is_held() -> None:
    robot = PlanarRobot()
    run = go(robot, 1.0, 0.5)

    def wait() -> None:
        for _ in range(10_000):
            run.step()

    with pytest.raises(ActionFailed, match="in the way"):
        wait()
    assert robot.navigation().goal is None


def test_the_map_shows_walls_and_pillars_and_nothing_behind_them() -> None:
    grid = PlanarRobot()._map
    cells = np.frombuffer(grid.cells, np.uint8).reshape(grid.height, grid.width)

    def at(x: float, y: float) -> int:
        column, row = (
            int((place - start) / grid.resolution) for place, start in zip((x, y), grid.origin, strict=False)
        )
        return int(cells[row, column])

    assert at(0.0, 0.0) == 0
    assert min(at(4.05, 0.0), at(2.0, 1.2 + 0.33)) >= OCCUPIED
    assert (at(4.17, 0.0), at(2.0, 1.2)) == (UNKNOWN, UNKNOWN)
