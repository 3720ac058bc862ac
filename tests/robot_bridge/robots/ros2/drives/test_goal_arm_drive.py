"""An arm behind ROS 2 that others move as well, through the bridge's shaping of goals; without a ROS, in simulated
time. What its controller was told, and by whom, says where it is.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.arm_goals import FOLLOWS
from lockstep.robot_bridge.robots.ros2.drives.goal_arm_drive import QUIET, GoalArmDrive
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from tests.robot_bridge.robots.ros2.test_tool_settings import JOINTS, POSTURE
from tests.robot_bridge.robots.ros2.test_tool_settings import settings as written

TICK, EVENT = 0.01, 0.04  # s
START = [0.0, -1.0, 1.0, 0.0, 0.5, 0.0]
NAMES = [f"arm.{name}" for name in JOINTS]
TOOL = ("tool.x", "tool.y", "tool.z", "tool.rx", "tool.ry", "tool.rz")
ARM = (
    f"  tool: {{tip: wrist_3, posture: {POSTURE}}}\n"
    "  command: {topic: commands, message: Float64MultiArray, interface: position}\n"
)


class Numbers:
    data: list[float]


class World:
    """The arm hangs `sag` below what its controller was told last, by the bridge or by others.

    Attributes:
        published: what the bridge told it
    """

    def __init__(self, directory: Path, monkeypatch: pytest.MonkeyPatch, sag: float = 0.0) -> None:
        self.now, self.sag = 100.0, sag
        monkeypatch.setattr(clock, "now", lambda: self.now)
        found, description = read_settings(written(directory, ARM))
        assert found.arm is not None
        self.names = [axis.name for axis in description.axes]
        self.told = [place + sag for place in START]
        self.published: list[list[float]] = []
        self.hears: Callable[[Any], None] = lambda _: None
        self.listeners = 1
        self.drive = GoalArmDrive(cast(RosSide, self), found.arm, description, TICK)
        self.shaper = AxisShaper(
            description.axes, hold=description.hold, poses=description.poses, pursued=lambda: self.drive.goals(self.now)
        )
        self.state()
        self.shaper.begin(self.drive.measured_axes(self.now), self.drive.goals(self.now))
        self.wait(1.0)

    # ROS

    topic_name = "/commands"

    def interface(self, _: str) -> type[Numbers]:
        return Numbers

    def publisher(self, *_: object) -> "World":
        return self

    def subscribe(self, _kind: object, _topic: str, callback: Callable[[Any], None]) -> None:
        self.hears = callback

    def get_subscription_count(self) -> int:
        return self.listeners

    def publish(self, message: Numbers) -> None:
        self.published.append(list(message.data))
        self.told = list(message.data)

    # The arm

    @property
    def joints(self) -> list[float]:
        return [place - self.sag for place in self.told]

    def state(self) -> None:
        stamp = SimpleNamespace(sec=0, nanosec=0)
        self.hears(SimpleNamespace(header=SimpleNamespace(stamp=stamp), name=JOINTS, position=self.joints, velocity=[]))

    def move(self, way: float, seconds: float = 1.0) -> None:
        """Let others move every joint of the arm."""
        for _ in range(round(seconds / TICK)):
            self.wait(TICK, way * TICK / seconds)

    # The bridge

    def wait(self, seconds: float, pushed: float = 0.0) -> None:
        """`pushed`: by others in each tick, half of it after the bridge has looked: a state comes at any time."""
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            self._push(pushed / 2)
            if self.shaper.may_take_up:
                self.shaper.take_up(self.drive.take_up(self.now))
            self._push(pushed / 2)
            self.drive.step(self.shaper.step(self.now, TICK), TICK)

    def _push(self, way: float) -> None:
        self.told = [place + way for place in self.told]
        self.state()

    def command(self, values: Mapping[str, float], seconds: float) -> None:
        for _ in range(round(seconds / EVENT)):
            self.shaper.drive([values.get(name) for name in self.names], self.now)
            self.wait(EVENT)

    def goal(self, name: str) -> float:
        goal = self.shaper.goals[self.names.index(name)]
        assert goal is not None
        return goal


@pytest.fixture(params=[0.0, 0.01])
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> World:
    return World(tmp_path, monkeypatch, request.param)


@pytest.mark.parametrize("driven", [(), NAMES[:1], ("tool.z",)])
def test_the_goals_follow_an_arm_that_others_move_and_nothing_is_published(
    world: World, driven: tuple[str, ...]
) -> None:
    if driven:
        world.command({name: world.goal(name) + 0.05 for name in driven}, 1.0)
        world.wait(1.0)
    before = len(world.published)
    for way in (0.33, -0.1, 0.004):
        world.move(way)
        assert [world.goal(name) for name in NAMES] == pytest.approx(world.joints, abs=FOLLOWS)
        tool = world.drive.measured_axes(world.now)[len(NAMES) :]
        assert [world.goal(name) for name in TOOL] == pytest.approx(tool, abs=10 * FOLLOWS)
    assert len(world.published) == before


def test_a_hand_that_is_still_after_engaging_moves_nothing(world: World) -> None:
    world.move(0.33)
    joints = world.joints
    for names in (NAMES, TOOL):
        world.command({name: world.goal(name) for name in names}, 1.0)
        world.wait(1.0)
    assert world.joints == pytest.approx(joints, abs=FOLLOWS + world.sag)


def test_a_hand_that_moves_by_a_hundredth_of_a_radian_moves_the_joint_by_that_from_where_it_is(world: World) -> None:
    world.move(0.33)
    began = world.joints
    world.command({NAMES[0]: world.goal(NAMES[0])}, 0.2)
    world.command({NAMES[0]: world.goal(NAMES[0]) + 0.01}, 0.04)
    world.command({NAMES[0]: world.goal(NAMES[0])}, 0.4)
    world.wait(1.0)
    slack = FOLLOWS + world.sag + 1e-6
    assert world.published
    for places in world.published:  # ahead by its horizon while it moves
        assert -FOLLOWS - 1e-6 <= places[0] - began[0] <= 0.02 + FOLLOWS
        assert places[1:] == pytest.approx(began[1:], abs=slack)
    assert world.joints[1:] == pytest.approx(began[1:], abs=slack)


def test_a_hand_that_moves_the_tool_by_five_millimetres_moves_it_from_where_it_is(world: World) -> None:
    world.move(0.2)
    began = world.joints
    goal = {name: world.goal(name) for name in TOOL}
    world.command(goal, 0.2)
    world.command({**goal, "tool.z": goal["tool.z"] + 0.005}, 1.0)
    assert world.joints == pytest.approx(began, abs=0.05)


@pytest.mark.parametrize("moved", [0.0, 0.2])
def test_an_arm_that_sags_while_it_is_held_does_not_creep_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moved: float
) -> None:
    world = World(tmp_path, monkeypatch, sag=0.01)
    world.move(moved)
    world.command({NAMES[1]: -0.9}, 1.5)
    world.wait(1.0)
    goals = world.shaper.goals
    world.wait(100 * TICK)
    assert world.shaper.goals == goals
    for _ in range(20):  # nor by being driven and released
        goal = world.goal(NAMES[1])
        world.command({NAMES[1]: goal + 0.02}, 0.4)
        world.command({NAMES[1]: goal}, 0.4)
        world.wait(QUIET + 0.1)
    assert goals[1] == -0.9
    assert world.shaper.goals == goals
    assert world.joints[1] == pytest.approx(-0.91, abs=1e-6)


def test_others_that_move_the_arm_do_not_disturb_a_drive_in_progress(world: World) -> None:
    values = {NAMES[0]: 0.2}
    world.command(values, 1.5)
    for _ in range(5):
        world.told = [place + 0.03 for place in world.told]
        world.command(values, EVENT)
        assert world.goal(NAMES[0]) == 0.2
    world.command({NAMES[0]: 0.3}, 0.8)
    assert world.goal(NAMES[0]) == 0.3
    assert world.joints[0] == pytest.approx(0.3 - world.sag, abs=1e-6)


def test_an_arm_that_was_pushed_right_after_it_was_driven_is_followed_when_it_is_quiet(world: World) -> None:
    world.command({NAMES[0]: 0.1}, 1.0)
    world.move(0.3, 0.1)
    assert world.goal(NAMES[0]) == 0.1
    world.wait(QUIET)
    assert world.goal(NAMES[0]) == pytest.approx(world.joints[0], abs=FOLLOWS)


def test_an_arm_that_was_moved_during_a_stop_is_followed_after_its_reset(world: World) -> None:
    world.command({NAMES[0]: 0.1}, 1.0)
    world.wait(1.0)
    world.drive.stop()
    before = len(world.published)
    world.move(0.3)
    world.drive.reset()
    world.shaper.begin(world.drive.measured_axes(world.now), world.drive.goals(world.now))
    world.wait(0.1)
    assert world.goal(NAMES[0]) == pytest.approx(world.joints[0], abs=FOLLOWS)
    assert len(world.published) == before


def test_an_arm_that_was_lost_while_it_was_driven_is_engaged_where_it_was_held(world: World) -> None:
    world.command({NAMES[0]: 0.5}, 0.3)
    world.listeners = 0
    world.command({NAMES[0]: 0.5}, 0.6)
    world.listeners = 1
    world.wait(1.0)
    before = len(world.published)
    assert world.goal(NAMES[0]) == pytest.approx(world.joints[0] + world.sag, abs=0.02)
    world.wait(1.0)
    assert len(world.published) == before
