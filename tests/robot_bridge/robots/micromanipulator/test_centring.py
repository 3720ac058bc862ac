"""The tip goes to what was clicked on in a picture, and a picture that is too old is refused."""

import math
from collections.abc import Iterator

import pytest

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.actions import ActionNotPossible
from lockstep.robot_bridge.robots.micromanipulator.centring import OLDEST
from lockstep.robot_bridge.robots.micromanipulator.robot import Micromanipulator

SCALE = 0.5e-6  # m per pixel
MOST = 2500  # ticks


@pytest.fixture
def robot() -> Iterator[Micromanipulator]:
    robot = Micromanipulator()
    check_description(robot.describe())
    robot._shown.shown(7, clock.now())  # a picture of event 7
    yield robot
    robot.close()


def test_the_tip_goes_to_the_place_that_was_clicked_on(robot: Micromanipulator) -> None:
    run = robot.begin_action("centre", {"x": 0.25, "y": 0.4, "event": 7.0})
    for _ in range(MOST):
        step = run.step()
        if step.done:
            break
        robot.apply([0.0 if value is None else value for value in step.values or [0.0] * 5])
        robot.tick()
    x, y, _ = robot.state().tip
    assert math.hypot(x - 0.1 * 480 * SCALE, y - 0.25 * 640 * SCALE) < 1e-6


@pytest.mark.parametrize("event", [6.0, 8.0, 7.5])
def test_a_picture_of_another_event_is_refused(robot: Micromanipulator, event: float) -> None:
    with pytest.raises(ActionNotPossible, match="too old"):
        robot.begin_action("centre", {"x": 0.5, "y": 0.5, "event": event})


def test_a_picture_that_is_too_old_is_refused(robot: Micromanipulator, monkeypatch: pytest.MonkeyPatch) -> None:
    later = clock.now() + OLDEST + 0.1
    monkeypatch.setattr(clock, "now", lambda: later)
    with pytest.raises(ActionNotPossible, match="too old"):
        robot.begin_action("centre", {"x": 0.5, "y": 0.5, "event": 7.0})


def test_a_place_that_the_tip_does_not_reach_is_refused(robot: Micromanipulator) -> None:
    with pytest.raises(ActionNotPossible, match="reach"):
        robot.begin_action("centre", {"x": 0.0, "y": 0.5, "event": 7.0})
