"""The joints' goals of an arm behind ROS 2, through the bridge's shaping of goals, in simulated time."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.arm_goals import MOVED, ArmGoals
from tests.robot_bridge.robots.ros2.test_tool_settings import JOINTS, POSTURE
from tests.robot_bridge.robots.ros2.test_tool_settings import settings as written

TICK, EVENT = 0.01, 0.04  # s
START = [0.0, -1.0, 1.0, 0.0, 0.5, 0.0]
NAMES = [f"arm.{name}" for name in JOINTS]


class World:
    """The arm is where its goals are, but for `offset`."""

    def __init__(self, directory: Path) -> None:
        path = written(directory, f"  tool: {{tip: wrist_3, posture: {POSTURE}}}\n")
        found, self.description = read_settings(path)
        assert found.arm is not None
        self.arm = found.arm
        self.goals = ArmGoals(found.arm, self.description, START)
        self.names = [axis.name for axis in self.description.axes]
        self._shaper = AxisShaper(
            self.description.axes,
            hold=self.description.hold,
            poses=self.description.poses,
            pursued=self.goals.pursued,
        )
        self._shaper.begin(self.goals.pursued(), self.goals.pursued())
        self._now = 0.0
        self.way = [list(START)]

    def command(self, values: Mapping[str, float], events: int = 1) -> None:
        for _ in range(events):
            self._shaper.drive([values.get(name) for name in self.names], self._now)
            self.wait(EVENT)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            values, before = self._shaper.step(self._now, TICK), list(self.goals.goals)
            rates = self.goals.drive(values, TICK, TICK, before, False)
            assert self.goals.goals == pytest.approx(np.add(before, np.multiply(rates, TICK)).tolist(), abs=1e-9)
            self.way.append(list(self.goals.goals))
            self._now += TICK

    def at(self, name: str) -> float:
        return self.goals.pursued()[self.names.index(name)]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("arm")


ways = st.tuples(*[st.floats(-0.4, 0.4)] * 3, *[st.floats(-2.0, 2.0)] * 3)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(way=ways, joint=st.integers(0, 5), events=st.integers(1, 20))
def test_tool_and_joints_in_turn_keep_rates_and_ranges_and_rest_within_hold(
    place: Path, way: tuple[float, ...], joint: int, events: int
) -> None:
    world = World(place)
    axes = ("tool.x", "tool.y", "tool.z", "tool.rx", "tool.ry", "tool.rz")
    world.command({name: world.at(name) + step for name, step in zip(axes, way, strict=True)}, events)
    world.command({NAMES[joint]: world.at(NAMES[joint]) + 0.3}, events)
    world.wait(world.description.hold)
    rest = list(world.goals.goals)
    world.wait(0.2)
    assert world.goals.goals == rest
    steps = np.abs(np.diff(np.array(world.way), axis=0))
    assert (steps <= np.array([each.maximum for each in world.arm.joints]) * TICK + 1e-9).all()
    for each, places in zip(world.arm.joints, np.array(world.way).T, strict=True):
        if each.lower is not None and each.upper is not None:
            assert each.lower <= places.min()
            assert places.max() <= each.upper


def test_an_arm_that_something_else_moved_goes_on_from_where_it_is(place: Path) -> None:
    world = World(place)
    near, away = [value + 0.9 * MOVED for value in START], [value + 0.3 for value in START]
    world.goals.take_up(near)
    assert world.goals.goals == START  # a load that pulls it down does not move its goal
    world.goals.take_up(away)
    assert world.goals.goals == away
    world.command({"tool.z": world.at("tool.z") - 0.05}, 5)
    assert world.way[1] == pytest.approx(away)


@pytest.mark.parametrize("place", [-2.95, -2.95 + 4 * math.pi, 3.34])
def test_a_joint_that_turns_on_and_on_was_not_moved_where_it_is_measured_a_turn_away(
    tmp_path: Path, place: float
) -> None:
    rows = "".join(f"    - {{name: {name}, maximum: 1.0}}\n" for name in JOINTS)
    found, description = read_settings(written(tmp_path, "  goals: true\n", rows=rows))
    assert found.arm is not None
    assert description.axes[5].wrap == math.tau
    goals = ArmGoals(found.arm, description, START)
    values = [*START[:5], 3.33]  # beyond half a turn, which drivers report as one from the other side
    goals.drive(START, TICK, TICK, START, False)
    while any(goals.drive(values, TICK, TICK, START, False)):
        pass
    assert goals.goals == values
    assert not goals.take_up([*START[:5], place])
    assert goals.goals == values
    assert goals.take_up([*START[:5], place + 0.3])
    assert goals.goals == [*START[:5], place + 0.3]


@pytest.mark.parametrize("fallen", [False, True])
def test_a_gripper_goes_on_squeezing_when_the_arm_is_driven_on(tmp_path: Path, fallen: bool) -> None:
    rows = "".join(f"    - {{name: {name}, maximum: 1.0}}\n" for name in JOINTS[:5])
    rows += f"    - {{name: {JOINTS[5]}, maximum: 1.0, grips: true}}\n"
    found, description = read_settings(written(tmp_path, "  goals: true\n", rows=rows))
    assert found.arm is not None
    assert [axis.grips for axis in description.axes] == [False] * 5 + [True]
    goals = ArmGoals(found.arm, description, START)
    values = [*START[:5], -0.3]  # it closes, and a block keeps it open
    goals.drive(START, TICK, TICK, START, False)
    for _ in range(100):
        goals.drive(values, TICK, TICK, START, False)
    held = list(START)
    goals.take_up(held)
    assert goals.goals[5] == -0.3
    if fallen:
        held[1] -= 0.4
        goals.take_up(held)
        assert goals.goals == [*held[:5], -0.3]
    held[5] += 0.2  # somebody opens it by hand
    goals.take_up(held)
    assert goals.goals[5] == held[5]


def closing(directory: Path) -> tuple[ArmGoals, list[float]]:
    """An arm whose gripper has just been told to close, and where it is."""
    rows = "".join(f"    - {{name: {name}, maximum: 1.0}}\n" for name in JOINTS[:5])
    rows += f"    - {{name: {JOINTS[5]}, maximum: 1.0, grips: true}}\n"
    found, description = read_settings(written(directory, "  goals: true\n", rows=rows))
    assert found.arm is not None
    goals = ArmGoals(found.arm, description, START)
    goals.drive(START, TICK, TICK, START, False)
    for _ in range(100):
        if not any(goals.drive([*START[:5], -0.3], TICK, TICK, START, False)):
            break
    return goals, list(START)


def test_a_gripper_that_was_opened_by_hand_in_a_stop_pressed_while_it_closed_does_not_close_again(
    tmp_path: Path,
) -> None:
    goals, measured = closing(tmp_path)
    goals.hold()
    measured[5] += 0.2  # somebody frees a hand from it before anything else has looked at the arm
    goals.restart()
    goals.take_up(measured)
    assert goals.goals[5] == measured[5]


def test_a_gripper_that_goes_on_closing_slowly_at_rest_keeps_its_goal(tmp_path: Path) -> None:
    goals, measured = closing(tmp_path)
    for _ in range(20):
        measured[5] += (goals.goals[5] - measured[5]) / 4
        goals.take_up(measured)
    assert goals.goals[5] == -0.3
    measured[5] += 0.1  # and is opened by hand then
    goals.take_up(measured)
    assert goals.goals[5] == measured[5]


def test_after_a_restart_the_next_values_move_nothing(place: Path) -> None:
    world = World(place)
    world.command({NAMES[0]: 0.4}, 5)
    world.goals.restart()
    held = list(world.goals.goals)
    assert not any(world.goals.drive([1.0] * 12, TICK, TICK, held, False))
    assert world.goals.goals == held
