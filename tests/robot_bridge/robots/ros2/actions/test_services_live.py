"""Services as actions, batteries and diagnostics as status: a bridge and a real ROS 2 node over DDS."""

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from lockstep.protocol.actions import Act, ActionUpdate, Status, StatusItem
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
