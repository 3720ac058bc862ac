"""The view goes to what was clicked on in a picture, and a picture that is too old is refused."""

import math
from collections.abc import Iterator

import pytest

from lockstep.protocol.actions import ParameterValue
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.actions import ActionNotPossible
from lockstep.robot_bridge.robots.micromanipulator.actions.centring import KEPT, OLDEST
from lockstep.robot_bridge.robots.micromanipulator.description import WINDOWS
from lockstep.robot_bridge.robots.micromanipulator.robot import Micromanipulator

MICRO = 1e-6
SCALE = 0.5e-6  # m per pixel
MOST = 2500  # ticks


@pytest.fixture
def robot() -> Iterator[Micromanipulator]:
    robot = Micromanipulator()
    check_description(robot.describe())
    robot._shown.shown(7, (0.0, 0.0), clock.now())  # a picture of event 7
    yield robot
    robot.close()


def run(robot: Micromanipulator, name: str, **parameters: ParameterValue) -> str:
    """What the action says at its end."""
    action = robot.begin_action(name, parameters)
    for _ in range(MOST):
        step = action.step()
        if step.done:
            return step.text
        robot.apply([0.0 if value is None else value for value in step.values or [0.0] * 7])
        robot.tick()
    raise AssertionError("it never ended")


def test_what_was_clicked_on_comes_to_the_middle_of_the_picture(robot: Micromanipulator) -> None:
    tip = robot.state().tip
    assert run(robot, "centre", x=0.35, y=0.4, event=7.0) == "there"
    x, y = robot.state().view
    assert math.hypot(x - 0.1 * 480 * SCALE, y - 0.15 * 640 * SCALE) < 1e-6
    assert robot.state().tip == tip


def test_a_place_is_that_of_the_picture_that_was_clicked_on_wherever_the_view_is_now(robot: Micromanipulator) -> None:
    """The operator saw a picture of an earlier event, from before the view moved."""
    run(robot, "centre", x=0.35, y=0.4, event=7.0)
    robot._shown.shown(8, robot.state().view, clock.now())
    run(robot, "centre", x=0.35, y=0.4, event=7.0)
    assert robot.state().view == pytest.approx((24 * MICRO, 48 * MICRO), abs=1e-6)
    run(robot, "centre", x=0.6, y=0.5, event=8.0)
    assert robot.state().view == pytest.approx((24 * MICRO, 16 * MICRO), abs=1e-6)


def test_the_tip_goes_to_the_middle_of_the_picture(robot: Micromanipulator) -> None:
    run(robot, "centre", x=0.35, y=0.4, event=7.0)
    view = robot.state().view
    run(robot, "tip_to_middle")
    state = robot.state()
    assert math.dist(state.tip[:2], view) < 1e-6
    assert state.view == view


def test_a_place_beyond_the_stage_comes_as_near_to_the_middle_as_the_stage_goes(robot: Micromanipulator) -> None:
    assert run(robot, "centre", x=0.0, y=0.5, event=7.0) == "as far as the stage goes"
    x, y = robot.state().view
    assert abs(x) < 1e-6
    assert WINDOWS["view.y"][1] - 2e-6 < y < WINDOWS["view.y"][1]


@pytest.mark.parametrize("event", [6.0, 8.0, 7.5])
def test_a_picture_of_another_event_is_refused(robot: Micromanipulator, event: float) -> None:
    with pytest.raises(ActionNotPossible, match="too old"):
        robot.begin_action("centre", {"x": 0.5, "y": 0.5, "event": event})


def test_a_picture_that_is_too_old_is_refused(robot: Micromanipulator, monkeypatch: pytest.MonkeyPatch) -> None:
    later = clock.now() + OLDEST + 0.1
    monkeypatch.setattr(clock, "now", lambda: later)
    with pytest.raises(ActionNotPossible, match="too old"):
        robot.begin_action("centre", {"x": 0.5, "y": 0.5, "event": 7.0})


def test_what_is_remembered_of_pictures_is_bounded(robot: Micromanipulator) -> None:
    for event in range(8, 8 + KEPT):
        robot._shown.shown(event, (0.0, 0.0), clock.now())
    with pytest.raises(ActionNotPossible, match="too old"):
        robot.begin_action("centre", {"x": 0.5, "y": 0.5, "event": 7.0})
