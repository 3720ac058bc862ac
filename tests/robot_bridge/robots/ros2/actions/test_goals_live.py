"""ROS 2 actions, grippers and goals on a map: a bridge and real action servers over DDS.

The interfaces that no wheel has are built from their text.
"""

import asyncio
import math
import secrets
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate, ParameterValue
from lockstep.protocol.maps import Navigation, map_cells
from lockstep.protocol.messages import Command, Feedback, Rest, Stop
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.client.held_up import ATTEMPTS, HELD_UP
from tests.robot_bridge.bridge_helpers import next_map
from tests.support.ros2 import (
    ACTIONS,
    EXAMPLES,
    PATIENCE,
    RosBridge,
    RosRobot,
    built_interfaces,
    have_compiler,
    have_ros,
    running_ros_bridge,
    running_ros_robot,
)

pytestmark = [
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
    pytest.mark.skipif(not have_compiler(), reason="there is no compiler for the interfaces that no wheel has"),
    pytest.mark.timeout(180),
]

MORE = """
watchdog: 0.25
actions:
  - name: count
    action: /count
    type: example_interfaces/Fibonacci
    parameters: [{field: order, minimum: 0, maximum: 100}]
    text: sequence
    result: sequence
    timeout: 10
  - {name: late, action: /late, type: example_interfaces/Fibonacci, timeout: 2}
grippers:
  - {open: 0.08, effort: 5}
map:
  goal: {}
"""


@pytest.fixture(scope="module")
def interfaces() -> Path:
    return built_interfaces()


@pytest.fixture
async def node(tmp_path: Path, interfaces: Path) -> AsyncIterator[RosRobot]:
    async with running_ros_robot(tmp_path, ACTIONS, interfaces=interfaces) as robot:
        yield robot


@pytest.fixture
async def bridge(tmp_path: Path, node: RosRobot) -> AsyncIterator[RosBridge]:
    settings = tmp_path / "acting.yaml"
    base = (EXAMPLES / "base.yaml").read_text().replace("ranges:\n", "ranges:\n  frame: base_link\n")
    settings.write_text(base + MORE)
    async with running_ros_bridge(tmp_path, node, settings) as bridge:
        yield bridge


class Armed:
    """An operator that sends neutral commands, which renew the action that it has asked for last."""

    def __init__(self, link: RobotLink) -> None:
        self.link = link
        self.renews = True
        self.values = [0.0, 0.0]
        self.id = ""
        self.update: ActionUpdate | None = None
        self.navigation: Navigation | None = None
        self.feedback: Feedback | None = None
        self._event = 0

    async def until(self, done: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not done():
                message = await anext(self.link)
                if isinstance(message, ActionUpdate) and message.id == self.id:
                    self.update = message
                elif isinstance(message, Navigation):
                    self.navigation = message
                elif isinstance(message, Feedback):
                    self.feedback = message
                    if self.renews:
                        self._send(message)

    def _send(self, feedback: Feedback) -> None:
        self.link.send(
            Command(
                event=event_after(feedback.event),
                issue=feedback.issue,
                values=self.values,
                nonce=feedback.nonce,
                action=self.id,
            )
        )

    async def ready(self) -> None:
        """Until a neutral command was executed, and the base is known."""
        await self.until(
            lambda: (
                self.feedback is not None
                and not self.feedback.neutral_needed
                and not self.feedback.faults
                and self.feedback.at_rest
            )
        )

    async def ask(self, name: str, **parameters: ParameterValue) -> ActionUpdate:
        """Ask until it runs or is refused: its server may not have been found yet."""
        while True:
            await self.ready()
            assert self.feedback is not None
            self.update, self.id = None, secrets.token_hex(8)
            act = Act(id=self.id, name=name, parameters=dict(parameters), nonce=self.feedback.nonce)
            self.link.send(act)
            self.link.send(act)  # a copy begins nothing
            update = await self._answer()
            if not update.text.startswith("nobody offers") and update.reason != "late":
                return update

    async def _answer(self) -> ActionUpdate:
        await self.until(lambda: self.update is not None)
        assert self.update is not None
        return self.update

    @property
    def has_ended(self) -> bool:
        return self.update is not None and self.update.state != "running"

    async def ended(self) -> ActionUpdate:
        await self.until(lambda: self.has_ended)
        assert self.update is not None
        return self.update


@pytest.fixture
async def armed(bridge: RosBridge) -> AsyncIterator[Armed]:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        yield Armed(link)


async def test_a_goal_runs_once_tells_its_progress_and_its_result(armed: Armed, node: RosRobot) -> None:
    await armed.ask("count", order=12.0)
    await armed.until(lambda: armed.update is not None and "[0, 1, 1" in armed.update.text)
    done = await armed.ended()
    assert (done.state, done.moves) == ("done", True)
    assert done.text.startswith("[0, 1, 1, 2, 3, 5, 8, 13")
    assert len(list(node.notes("goal"))) == 1, "a copy of the request begins nothing"
    assert not list(node.notes("cancel"))


async def test_a_goal_that_is_refused_and_one_that_is_aborted_have_failed(armed: Armed) -> None:
    await armed.ask("count", order=99.0)
    refused = await armed.ended()
    assert (refused.state, refused.text) == ("failed", "/count refused the goal")
    await armed.ask("count", order=7.0)
    aborted = await armed.ended()
    assert (aborted.state, aborted.text.partition(":")[0]) == ("failed", "/count was aborted by its server")


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("silence", "not_renewed"),
        ("stick", "driving"),
        ("rest", "rested"),
        ("stop", "stopped"),
        ("cancel", "cancelled"),
        ("link", ""),
        ("kill", ""),
        ("end", ""),
    ],
)
async def test_whatever_ends_an_armed_motion_cancels_the_goal_at_its_server(
    armed: Armed, node: RosRobot, bridge: RosBridge, how: str, reason: str
) -> None:
    await armed.ask("count", order=90.0)
    await armed.until(lambda: armed.update is not None and armed.update.text.startswith("["))
    assert armed.feedback is not None
    match how:
        case "silence":
            armed.renews = False
        case "stick":
            armed.values = [0.2, 0.0]
        case "rest":
            armed.link.send(Rest(event=event_after(armed.feedback.event)))
        case "stop":
            armed.link.send(Stop(by="test"))
        case "cancel":
            armed.link.send(ActionCancel(id=armed.id))
        case "link":
            await armed.link.close()
        case "kill":
            await bridge.process.kill()
        case "end":
            await bridge.process.end()
    if reason:
        ended = await armed.ended()
        assert ended.state == "cancelled", ended.text
        assert ended.reason in (reason, "interrupted"), "a machine that holds the bridge up interrupts it too"
    try:
        ends = await node.noted("ended", lambda notes: len(notes) > 0)
    except TimeoutError:
        raise AssertionError("\n".join(list(bridge.process.output.errors)[-30:])) from None
    assert ends[0]["how"] == "canceled"
    assert ends[0]["count"] < 90


async def test_a_goal_that_is_accepted_after_its_cancel_is_cancelled_then(armed: Armed, node: RosRobot) -> None:
    await node.tell("slow")
    await armed.ask("count", order=90.0)
    armed.link.send(ActionCancel(id=armed.id))
    assert (await armed.ended()).reason in ("cancelled", "interrupted")
    ends = await node.noted("ended", lambda notes: len(notes) > 0)
    assert ends[0]["how"] == "canceled"


async def test_a_goal_whose_server_was_lost_before_it_accepted_is_cancelled_when_it_accepts_late(
    armed: Armed, node: RosRobot
) -> None:
    """Its server is lost for longer than a running goal waits, is found again, does not know it, and then accepts."""
    await armed.ask("late")
    await node.noted("late_asked", lambda notes: len(notes) == 1)
    await node.tell("hide")
    ended = await armed.ended()
    assert (ended.state, ended.text) == ("failed", "nobody offers the action /late any more")
    fault = "/late: the cancelled goal has not ended"
    await armed.until(lambda: armed.feedback is not None and any(f.startswith(fault) for f in armed.feedback.faults))
    await node.tell("show")
    await armed.until(lambda: armed.feedback is not None and not armed.feedback.faults)
    assert list(node.notes("late_unknown")), "it is asked by the goal's id before it is given up"
    assert not list(node.notes("late_accepted"))
    await node.tell("accept")
    await node.noted("late_cancelled", lambda notes: len(notes) > 0)


async def test_a_goal_that_is_accepted_while_its_bridge_ends_is_cancelled(
    armed: Armed, node: RosRobot, bridge: RosBridge
) -> None:
    await node.tell("slow")
    await armed.ask("count", order=90.0)
    await bridge.process.end()
    ends = await node.noted("ended", lambda notes: len(notes) > 0)
    assert ends[0]["how"] == "canceled"


async def test_a_server_that_goes_on_after_the_cancel_is_a_fault_and_gets_no_other_goal(
    armed: Armed, node: RosRobot
) -> None:
    await armed.ask("count", order=90.0)
    await armed.until(lambda: armed.update is not None and armed.update.text.startswith("["))
    await node.tell("stubborn")
    armed.link.send(ActionCancel(id=armed.id))
    await armed.ended()
    await armed.until(lambda: armed.feedback is not None and any("not ended" in f for f in armed.feedback.faults))
    await node.noted("cancel", lambda notes: len(notes) > 3)  # it is tried again and again


async def test_the_gripper_takes_a_thing_and_says_so(armed: Armed, node: RosRobot) -> None:
    await armed.ask("gripper", opening=100.0)
    done = await armed.ended()
    assert (done.state, done.text) == ("done", "at 0.08 m")
    await armed.ask("gripper", opening=0.0)
    done = await armed.ended()
    assert (done.state, done.text) == ("done", "at 0.02 m, holds something")
    assert [(note["position"], note["effort"]) for note in node.notes("grip")] == [(0.08, 5.0), (0.0, 5.0)]


async def test_a_goal_on_the_map_drives_the_base_there_with_path_and_place(
    armed: Armed, node: RosRobot, bridge: RosBridge
) -> None:
    await armed.until(lambda: armed.navigation is not None and armed.navigation.located and armed.navigation.map != "")
    assert armed.navigation is not None
    assert armed.navigation.frame == pytest.approx((1.0, -0.5, 0.0))
    async with RobotLink(*bridge.address, "media", name="test") as media:
        message = await next_map(media)
    assert message.id == armed.navigation.map
    assert (message.width, message.height) == (80, 60)
    cells = map_cells(message)
    assert (cells[0], cells[60], cells[79]) == (0, 100, 255)
    for _ in range(ATTEMPTS):
        await armed.ask("go_to", x=2.0, y=0.0, yaw=1.5)
        await armed.until(
            lambda: armed.has_ended or (armed.navigation is not None and len(armed.navigation.path) == 22)
        )
        shown = armed.navigation
        done = await armed.ended()
        if done.reason not in HELD_UP:  # a busy machine ends what moves, and a person asks again
            break
    assert done.state == "done"
    assert shown.goal == [2.0, 0.0, 1.5]
    assert shown.path[-2:] == pytest.approx([2.0, 0.0])
    assert armed.feedback is not None
    x, y, yaw = armed.feedback.joints
    assert math.hypot(x - 1.0, y - 0.5) < 0.15
    assert abs(yaw - 1.5) < 0.15
    *_, asked = node.notes("navigate")
    assert (asked["frame"], asked["x"], asked["y"]) == ("map", 2.0, 0.0)
    await armed.until(lambda: armed.navigation is not None and not armed.navigation.goal)


async def test_a_goal_on_the_map_rests_when_nothing_renews_it_and_a_robot_that_is_lost_says_so(
    armed: Armed, node: RosRobot
) -> None:
    await armed.ask("go_to", x=4.0, y=-0.5, yaw=0.0)
    await armed.until(lambda: armed.feedback is not None and armed.feedback.axes[0] > 0.1)
    armed.renews = False
    assert (await armed.ended()).reason in ("not_renewed", "interrupted")
    await node.noted("ended", lambda notes: [note["how"] for note in notes] == ["canceled"])
    await armed.until(lambda: armed.feedback is not None and armed.feedback.at_rest)
    assert armed.feedback is not None
    assert armed.feedback.joints[0] < 2.5
    await node.tell("lost")
    await node.tell("wall")
    before = "" if armed.navigation is None else armed.navigation.map
    await armed.until(lambda: armed.navigation is not None and armed.navigation.map not in ("", before))
    await armed.until(lambda: armed.navigation is not None and not armed.navigation.located)


async def test_a_scanner_that_looks_back_by_tf_shows_what_it_sees_behind(armed: Armed) -> None:
    await armed.ready()
    await armed.until(lambda: armed.feedback is not None and min(armed.feedback.ranges, default=9.0) < 7.0)
    assert armed.feedback is not None
    ranges = armed.feedback.ranges  # the node's wall is ahead of its scanner
    assert min(ranges[0], ranges[1], ranges[-1]) < 4.0
    assert ranges[36] > 7.0
