"""Services as actions, batteries and diagnostics as status: a bridge and a real ROS 2 node over DDS."""

import asyncio
import math
import secrets
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from lockstep.protocol.actions import Act, ActionUpdate, Status, StatusItem
from lockstep.protocol.maps import Navigation
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.robot_bridge.bridge_helpers import Operator
from tests.support.ros2 import (
    EXAMPLES,
    PATIENCE,
    SERVICES,
    RosRobot,
    have_ros,
    running_ros_bridge,
    running_ros_robot,
)

pytestmark = [
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
]

MORE = """
services:
  - {name: light, service: /light, type: SetBool, label: Light}
  - {name: beep, service: /beep}
  - {name: calibrate, service: /calibrate, confirm: "Is the lid open?"}
  - {name: nobody, service: /nobody}
batteries:
  - {topic: /battery_state}
diagnostics: {most: 4}
readings:
  - {topic: /mode, name: mode, label: Mode}
  - {topic: /motor_temperature, name: heat, message: Temperature, warning: 60, error: 80}
  - {topic: /load, name: load, message: Float32, unit: A}
  - {topic: /depth, name: depth, message: Float64, unit: m}
  - {topic: /parts, name: parts, message: Int32}
  - {topic: /door, name: door, message: Bool}
lockout: {topic: /emergency_stop, hardware_stop: true}
"""


@pytest.fixture
async def node(tmp_path: Path) -> AsyncIterator[RosRobot]:
    async with running_ros_robot(tmp_path, SERVICES) as robot:
        yield robot


@pytest.fixture
async def operator(tmp_path: Path, node: RosRobot) -> AsyncIterator[Operator]:
    settings = tmp_path / "serving.yaml"
    settings.write_text((EXAMPLES / "base.yaml").read_text() + MORE)
    async with (
        running_ros_bridge(tmp_path, node, settings) as bridge,
        RobotLink(*bridge.address, "operator", name="test") as link,
    ):
        operator = Operator(link)
        async with asyncio.timeout(PATIENCE):
            await operator.next(Feedback)
        yield operator


async def outcome(operator: Operator, name: str, **parameters: bool) -> ActionUpdate:
    """Ask for the action until it is known: its service may not have been found yet. Return how it ends."""
    async with asyncio.timeout(PATIENCE):
        while True:
            nonce = (await operator.next(Feedback)).nonce
            act = Act(id=secrets.token_hex(8), name=name, parameters=dict(parameters), nonce=nonce)
            operator.link.send(act)
            while True:
                update = await operator.next(ActionUpdate)
                if update.id == act.id and update.state != "running":
                    break
            if update.reason not in ("not_possible", "late") or name == "nobody" and update.reason != "late":
                return update


async def status_of(operator: Operator, condition: Callable[[dict[str, StatusItem]], bool]) -> dict[str, StatusItem]:
    """The status items by name, once they meet the condition."""
    async with asyncio.timeout(PATIENCE):
        while True:
            items = {item.name: item for item in (await operator.next(Status)).items}
            if condition(items):
                return items


async def test_a_trigger_and_a_switch_are_called_once_each_and_answer_in_words(
    operator: Operator, node: RosRobot
) -> None:
    done = await outcome(operator, "light", on=True)
    assert (done.state, done.text, done.moves) == ("done", "on", False)
    assert [note["on"] for note in node.notes("light")] == [True]
    await outcome(operator, "light", on=False)
    assert [note["on"] for note in node.notes("light")] == [True, False]
    done = await outcome(operator, "beep")
    assert (done.state, done.text) == ("done", "it[31m beeped"), "a terminal would obey the escape character"
    assert len(list(node.notes("beep"))) == 1


async def test_a_service_that_says_no_has_failed_and_one_that_nobody_offers_is_not_possible(operator: Operator) -> None:
    failed = await outcome(operator, "calibrate")
    assert (failed.state, failed.text) == ("failed", "the lid is open")
    refused = await outcome(operator, "nobody")
    assert (refused.state, refused.reason) == ("refused", "not_possible")
    assert refused.text == "nobody offers the service /nobody"


async def test_the_battery_and_the_components_are_the_status(operator: Operator, node: RosRobot) -> None:
    well = await status_of(operator, lambda items: len(items) >= 5)
    battery = well["battery"]
    assert (battery.kind, battery.level) == ("battery", "ok")
    assert battery.value == pytest.approx(0.8)
    assert [name for name in well if name.startswith("diag")] == ["diagnostics/lidar", "diagnostics/motors: left"]
    await node.tell("level motors: left 2")
    await node.tell("charge 0.1")
    hot = await status_of(
        operator, lambda items: items["battery"].level != "ok" and "error" in {item.level for item in items.values()}
    )
    assert hot["battery"].value == pytest.approx(0.1)
    assert hot["battery"].text == "charge it soon"
    worst = hot["diagnostics/motors: left"]
    assert (worst.level, worst.value, worst.text) == ("error", "too hot", "too hot")
    assert next(name for name in hot if name.startswith("diag")) == worst.name, "the worst comes first"
    await node.tell("charge nan")
    volts = await status_of(operator, lambda items: items["battery"].kind == "number")
    assert (volts["battery"].value, volts["battery"].unit) == (24.5, "V")


async def test_temperatures_numbers_and_switches_of_topics_are_the_status(operator: Operator) -> None:
    wanted = {"heat", "load", "depth", "parts", "door"}
    items = await status_of(operator, lambda items: items.keys() >= wanted)
    said = {name: (items[name].kind, items[name].value, items[name].unit, items[name].level) for name in wanted}
    assert said == {
        "heat": ("temperature", 61.5, "°C", "warning"),
        "load": ("number", 0.25, "A", "ok"),
        "depth": ("number", -3.5, "m", "ok"),
        "parts": ("number", 7.0, "", "ok"),
        "door": (items["door"].kind, True, "", "ok"),
    }
    assert items["heat"].text == "above 60"


@pytest.mark.parametrize(
    ("message", "topic", "x"), [("PoseWithCovarianceStamped", "/amcl_pose", 3.0), ("PoseStamped", "/pose", 4.0)]
)
async def test_a_pose_of_a_topic_says_where_the_robot_is_on_the_map(
    tmp_path: Path, node: RosRobot, message: str, topic: str, x: float
) -> None:
    settings = tmp_path / "mapped.yaml"
    place = f"{{source: topic, topic: {topic}, message: {message}}}"
    settings.write_text((EXAMPLES / "base.yaml").read_text() + f"map: {{durable: false, place: {place}}}\n")
    async with (
        running_ros_bridge(tmp_path, node, settings) as bridge,
        RobotLink(*bridge.address, "operator", name="test") as link,
    ):
        operator = Operator(link)
        async with asyncio.timeout(PATIENCE):
            while not (told := await operator.next(Navigation)).located:
                pass
            feedback = await operator.next(Feedback)
        description = link.hello.description
        assert description is not None
        planar = description.map
        assert planar is not None
        joints = [joint.name for joint in description.joints]
        at = [feedback.joints[joints.index(name)] for name in (planar.x, planar.y, planar.yaw)]
    east, north, yaw = told.frame
    assert east + at[0] * math.cos(yaw) - at[1] * math.sin(yaw) == pytest.approx(x, abs=0.01)
    assert north + at[0] * math.sin(yaw) + at[1] * math.cos(yaw) == pytest.approx(4.0, abs=0.01)
    assert math.remainder(yaw + at[2] - math.pi / 2, math.tau) == pytest.approx(0.0, abs=0.01)


async def test_the_mode_and_the_hardware_stop_are_the_status_and_a_pressed_one_stops_the_robot(
    operator: Operator, node: RosRobot
) -> None:
    well = await status_of(operator, lambda items: "mode" in items and "hardware_stop" in items)
    assert (well["mode"].kind, well["mode"].value, well["mode"].label) == ("mode", "AUTO", "Mode")
    assert (well["hardware_stop"].value, well["hardware_stop"].level) == (False, "ok")
    await node.tell("press")
    pressed = await status_of(operator, lambda items: items["hardware_stop"].value is True)
    assert pressed["hardware_stop"].level == "error"
    async with asyncio.timeout(PATIENCE):
        while not (await operator.next(Feedback)).stop.stopped:
            pass
