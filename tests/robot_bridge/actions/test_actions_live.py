"""Actions of a whole bridge over real TCP: what moves the robot lives only while armed events renew it."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from typing import cast

import msgspec
import pytest

from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate, ParameterValue, Status, StatusItem
from lockstep.protocol.description import Action, RobotDescription
from lockstep.protocol.messages import Feedback, Rest, Stop
from lockstep.robot_bridge.actions.renewal import LONGEST
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import RobotFailed
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.actions import ActionDone, ActionFailed, ActionNotPossible, ActionRun, ActionStep
from lockstep.robot_bridge.robots.planar.robot import PlanarState
from lockstep.robot_bridge.robots.planar.room import DOCK
from tests.robot_bridge.bridge_helpers import (
    NEUTRAL,
    PATIENCE,
    Operator,
    RecordingRobot,
    log_lines,
    operator,
    running_bridge,
)

MARGIN = 0.05  # s between the bridge's reading of the clock and the test's, on a busy machine
AWAY = PlanarState(x=0.5, y=0.2, yaw=0.3)
BEFORE_DOCK = PlanarState(x=3.1, y=-1.0, yaw=-1.2)


class HomingRobot(RecordingRobot):
    """Begins away from its home."""

    def __init__(self) -> None:
        super().__init__()
        self._state = AWAY


class OwnMotion(ActionRun):
    def __init__(self, robot: "OwnWayRobot") -> None:
        self._robot = robot

    def step(self) -> ActionStep:
        self._robot.calls.append("step")
        if self._robot.fails is not None:
            raise self._robot.fails
        return ActionStep(0.5, "docking")

    def cancel(self) -> None:
        self._robot.calls.append("cancel")
        if self._robot.cancel_fails:
            raise OSError("the motor does not answer")


class OwnWayRobot(RecordingRobot):
    """Docks in a way of its own, not by its axes; has a light, and a hardware stop."""

    fails: Exception | None = None
    cancel_fails = False
    pressed: bool | None = None

    def describe(self) -> RobotDescription:
        actions = (Action(name="dock", label="Dock"), Action(name="light", label="Light", moves=False))
        return msgspec.structs.replace(super().describe(), actions=actions, map=None)

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        if name == "light":
            return ActionDone("on")
        if self.fails is not None and isinstance(self.fails, ActionNotPossible):
            raise self.fails
        return OwnMotion(self)

    def hardware_stop(self) -> bool | None:
        return self.pressed

    def status(self) -> Sequence[StatusItem]:
        good = StatusItem(
            name="battery", label="Battery", kind="battery", value=0.4, level="warning", text="charge soon"
        )
        return [good, StatusItem(name="wrong", label="Wrong", kind="number", value=float("nan"))]


async def ask(driver: Operator, name: str, id: str = "id-1") -> ActionUpdate:
    """Ask for an action; its first update."""
    driver.link.send(Act(id=id, name=name, nonce=driver.feedback.nonce, by="test"))
    return await driver.next(ActionUpdate)


async def renew(driver: Operator, id: str = "id-1") -> None:
    """One armed event that lets the action go on. It does not wait for its feedback."""
    driver.link.send(msgspec.structs.replace(driver.command(list(NEUTRAL)), action=id))


async def until_final(driver: Operator, *, renews: str = "") -> ActionUpdate:
    """Go on until an update is final; renew with every feedback, or stay silent."""
    while True:
        message = await driver._next((Feedback, ActionUpdate))
        if isinstance(message, ActionUpdate) and message.state != "running":
            return message
        if isinstance(message, Feedback) and renews:
            await renew(driver, renews)


async def test_home_drives_the_robot_home_while_armed_events_renew_it() -> None:
    robot = HomingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        robot._home = (0.0, 0.0, 0.0)
        begun = await ask(driver, "home")
        assert (begun.state, begun.moves, begun.by, begun.began) == ("running", True, "test", begun.event)
        await renew(driver)
        final = await until_final(driver, renews="id-1")
        assert (final.state, final.text, final.progress) == ("done", "at home", 1.0)
        assert final.event > begun.event, "the armed events went on"
        x, y, _ = robot.state[:3]
        assert max(abs(x), abs(y)) < 0.02
        repeated = await ask(driver, "home")
        assert repeated == final, "a repeat is answered from memory"
        await driver.heard(lambda feedback: feedback.at_rest)


async def test_dock_drives_the_robot_to_its_charger_while_armed_events_renew_it() -> None:
    robot = HomingRobot()
    robot._state = BEFORE_DOCK
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        assert (await ask(driver, "dock")).moves
        await renew(driver)
        final = await until_final(driver, renews="id-1")
        assert (final.state, final.text, final.progress) == ("done", "at the charger", 1.0)
        await driver.heard(lambda feedback: feedback.at_rest)
        level = robot.status()[0].value
        async with asyncio.timeout(PATIENCE):
            while robot.status()[0].value == level:
                await driver.drive(list(NEUTRAL))
        assert float(robot.status()[0].value) > float(level)


async def test_dock_ends_where_the_robot_is_when_nothing_renews_it() -> None:
    robot = HomingRobot()
    robot._state = BEFORE_DOCK
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        assert (await ask(driver, "dock")).state == "running"
        final = await until_final(driver)
        assert (final.state, final.reason) == ("cancelled", "not_renewed")
        await driver.heard(lambda feedback: feedback.at_rest)
        assert robot.state.y > DOCK[1] + 0.2
        assert robot.navigation().goal is None


async def test_a_link_that_opens_is_told_how_long_ago_an_action_ended() -> None:
    async with running_bridge(HomingRobot()) as bridge:
        async with operator(bridge) as driver:
            await ask(driver, "home")
            final = await until_final(driver)
        await asyncio.sleep(0.02)  # something that has an age
        async with RobotLink(*bridge.address, "operator", name="test") as link:
            told = await Operator(link).next(ActionUpdate)
    assert final.age == 0.0
    assert told.age >= 0.02
    assert msgspec.structs.replace(told, age=0.0) == final


async def test_without_renewal_the_robot_is_at_rest_when_hold_has_passed(tmp_path: Path) -> None:
    robot, log = HomingRobot(), tmp_path / "events.jsonl"
    async with running_bridge(robot, event_log=log) as bridge, operator(bridge) as driver:
        await ask(driver, "home")
        final = await until_final(driver)
        assert (final.state, final.reason) == ("cancelled", "not_renewed")
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
        hold = bridge.description.hold
    began = cast(float, log_lines(log, "action")[0]["time"])
    assert any(values != NEUTRAL for when, values in robot.applied if when >= began)
    assert all(values == NEUTRAL for when, values in robot.applied if when >= began + hold + MARGIN)


async def test_over_a_path_that_takes_longer_than_hold_home_goes_on_with_each_renewal(tmp_path: Path) -> None:
    robot, log = HomingRobot(), tmp_path / "events.jsonl"
    robot._state = PlanarState(x=1.5, y=0.2, yaw=0.3)

    def is_home() -> bool:
        return math.hypot(*robot.state[:2]) < 0.02

    async with running_bridge(robot, event_log=log) as bridge, operator(bridge) as driver:
        robot._home = (0.0, 0.0, 0.0)
        await ask(driver, "home")
        rests = 0
        while not is_home():
            await robot.until(lambda: robot.applied[-1][1] != NEUTRAL or is_home(), "it moves")
            await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "it rests, because nothing renews it")
            while not (await driver.drive(list(NEUTRAL))).at_rest:
                pass
            rests += 1
            await renew(driver)
        final = await until_final(driver, renews="id-1")
        assert (final.state, final.text) == ("done", "at home")
        hold = bridge.description.hold
    assert rests > 1
    renewed = [cast(float, line["time"]) for kind in ("action", "executed") for line in log_lines(log, kind)]
    for when, values in robot.applied:
        assert values == NEUTRAL or any(each - MARGIN < when < each + hold + MARGIN for each in renewed)


class Mixed(OwnMotion):
    """Moves something in its own way beside the axes."""

    def step(self) -> ActionStep:
        super().step()
        return ActionStep(0.5, values=NEUTRAL)


class MixedRobot(OwnWayRobot):
    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        return Mixed(self)


async def test_an_action_that_does_not_say_that_it_waits_is_cancelled_at_hold_whatever_its_steps_are(
    tmp_path: Path,
) -> None:
    robot, log = MixedRobot(), tmp_path / "events.jsonl"
    async with running_bridge(robot, event_log=log) as bridge, operator(bridge) as driver:
        await ask(driver, "dock")
        final = await until_final(driver)
        assert (final.state, final.reason) == ("cancelled", "not_renewed")
        hold = bridge.description.hold
    began, ended = (cast(float, line["time"]) for line in log_lines(log, "action"))
    assert hold <= ended - began < LONGEST, "as soon as the ticks allow"
    assert robot.calls.count("cancel") == 1


async def stick(driver: Operator) -> None:
    driver.link.send(msgspec.structs.replace(driver.command([0.0, 0.1, 0.0]), action="id-1"))


async def stop(driver: Operator) -> None:
    driver.link.send(Stop())


async def let_go(driver: Operator) -> None:
    driver.link.send(Rest(event=driver.feedback.event))


async def cancel(driver: Operator) -> None:
    driver.link.send(ActionCancel(id="id-1"))


async def stale_stick(driver: Operator) -> None:
    driver.link.send(msgspec.structs.replace(driver.command([0.0, 0.1, 0.0]), nonce=1))


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        (stick, "driving"),
        (stale_stick, "driving"),
        (stop, "stopped"),
        (let_go, "rested"),
        (cancel, "cancelled"),
    ],
)
@pytest.mark.parametrize("name", ["home", "dock"])
async def test_a_stick_a_stop_a_rest_and_a_cancel_end_what_moves(
    end: Callable[[Operator], Awaitable[None]], reason: str, name: str
) -> None:
    robot = HomingRobot() if name == "home" else OwnWayRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        assert (await ask(driver, name)).state == "running"
        await end(driver)
        final = await until_final(driver)
        assert (final.state, final.reason) == ("cancelled", reason)
        if name == "dock":
            assert robot.calls.count("cancel") == 1


async def test_a_lost_link_cancels_and_the_next_console_hears_of_it() -> None:
    robot = OwnWayRobot()
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            await ask(driver, "dock")
        await robot.until(lambda: "cancel" in robot.calls, "cancelled")
        async with RobotLink(*bridge.address, "operator", name="test") as link:
            final = await Operator(link).next(ActionUpdate)
        assert (final.id, final.state, final.reason) == ("id-1", "cancelled", "link_down")


async def test_a_stopped_robot_begins_nothing_and_after_the_reset_a_neutral_command_comes_first() -> None:
    async with running_bridge(OwnWayRobot()) as bridge, operator(bridge) as driver:
        driver.link.send(Stop())
        await driver.heard(lambda feedback: feedback.stop.stopped)
        assert (await ask(driver, "dock", "a")).reason == "stopped"
        assert (await ask(driver, "light", "b")).reason == "stopped"
        await driver.reset()
        assert (await ask(driver, "dock", "c")).reason == "not_neutral"
        assert (await ask(driver, "light", "d")).state == "running"
        await driver.arm()
        assert (await ask(driver, "dock", "e")).state == "running"


async def test_an_action_that_the_robot_does_not_take_is_refused_and_one_that_fails_says_why() -> None:
    robot = OwnWayRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        robot.fails = ActionNotPossible("the dock is taken")
        refused = await ask(driver, "dock", "a")
        assert (refused.state, refused.reason, refused.text) == ("refused", "not_possible", "the dock is taken")
        robot.fails = ActionFailed("the dock was not found")
        await ask(driver, "dock", "b")
        final = await until_final(driver)
        assert (final.state, final.text) == ("failed", "the dock was not found")
        assert bridge.counters.actions == {"refused": 1, "running": 1, "failed": 1}


@pytest.mark.parametrize("when", ["begin", "step", "cancel"])
async def test_an_adapter_that_raises_in_an_action_ends_the_bridge_with_the_robot_at_rest(when: str) -> None:
    robot = OwnWayRobot()
    bridge: Bridge
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        if when == "begin":
            robot.begin_action = None  # type: ignore[method-assign, assignment]
        await ask(driver, "dock")
        robot.cancel_fails = when == "cancel"
        if when == "step":
            robot.fails = OSError("no answer")
        driver.link.send(ActionCancel() if when == "cancel" else Rest(event=1))
        with pytest.raises(RobotFailed):
            await bridge.wait()
        assert robot.applied[-1][1] == NEUTRAL
        assert "stop" in robot.calls


async def test_a_hardware_stop_that_is_pressed_locks_the_robot_and_stands_in_the_status() -> None:
    robot = OwnWayRobot()
    robot.pressed = False
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        status = await driver.next(Status)
        assert [(item.name, item.value) for item in status.items] == [("hardware_stop", False), ("battery", 0.4)]
        await ask(driver, "dock")
        robot.pressed = True
        final = await until_final(driver)
        assert (final.state, final.reason) == ("cancelled", "locked_out")
        while (status := await driver.next(Status)).items[0].value is not True:
            pass
        assert status.items[0].level == "error"
        assert driver.feedback.stop.locked_out == "the hardware stop is pressed"
        robot.pressed = False
        await driver.heard(lambda feedback: not feedback.stop.locked_out)
        assert driver.feedback.stop.stopped, "the end of the lock releases nothing"


class SlowLightRobot(OwnWayRobot):
    """Its light goes on slowly, which a lost link does not end."""

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        return OwnMotion(self)


async def test_an_action_that_runs_when_the_bridge_ends_has_its_end_in_the_log(tmp_path: Path) -> None:
    log = tmp_path / "events.jsonl"
    async with running_bridge(SlowLightRobot(), event_log=log) as bridge, operator(bridge) as driver:
        assert (await ask(driver, "light")).state == "running"
        await bridge.close()
    states = [(line["state"], line["reason"]) for line in log_lines(log, "action")]
    assert states == [("running", ""), ("cancelled", "interrupted")]
    assert bridge.counters.actions["cancelled"] == 1
