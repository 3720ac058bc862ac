"""What somebody at the robot decides, as people far away see it: a lock-out, and a warning before the first motion."""

import asyncio
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec
import pytest
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import RB
from lockstep.bench.harness.processes import running_process
from lockstep.protocol.description import Axis, RobotDescription, StartWarning
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.base import Measurement
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from lockstep.robot_bridge.settings import BridgeSettings
from tests.support.stack import Stack, running_console

pytestmark = pytest.mark.browser

RESET = """(number) => fetch("/api/reset", {
  method: "POST",
  headers: {
    Authorization: `Bearer ${new URLSearchParams(location.hash.slice(1)).get("token")}`,
    "Content-Type": "application/json",
  },
  body: JSON.stringify({ number }),
}).then(async (answer) => [answer.status, (await answer.json()).error])"""


@asynccontextmanager
async def console_with_a_switch(directory: Path) -> AsyncIterator[tuple[Stack, Path]]:
    """`lockstep robot --lockout-file` and `lockstep serve`, as on two machines; and the switch."""
    switch, log = directory / "locked", directory / "events.jsonl"
    lockstep = str(Path(sys.executable).with_name("lockstep"))
    state = ("--state-dir", str(directory / "bridge"))
    options = ("--port", "0", "--json", "--lockout-file", str(switch), "--event-log", str(log), *state)
    async with (
        running_process(lockstep, "robot", "planar", *options) as (_, ready),
        running_console(directory, ready["robot"], log) as stack,
    ):
        yield stack, switch


async def test_a_lock_at_the_robot_stops_it_for_everybody_and_takes_no_reset_until_it_is_off(
    tmp_path: Path, chromium: Browser
) -> None:
    async with (
        console_with_a_switch(tmp_path) as (stack, switch),
        open_console(chromium, stack.operator) as operator,
        open_console(chromium, stack.supervisor, pad=False) as supervisor,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        everybody = (operator, supervisor, observer)
        for page in everybody:
            await page.until("s.connected && s.event !== null")
        await operator.arm()
        await operator.drive_forward()
        switch.touch()
        await operator.until("!s.armed && s.at_rest === true")
        for page in everybody:
            plate = page.page.locator(".plate")
            await plate.get_by_text("Locked", exact=True).wait_for()
            await plate.get_by_text("Somebody at the robot has locked it").wait_for()
            await expect(plate.get_by_role("button").locator("visible=true")).to_have_count(0)
        number = (await supervisor.stats())["stop"]["number"]
        await _until_old(stack, number)
        assert await supervisor.page.evaluate(RESET, number) == [409, "locked_out"]

        switch.unlink()
        await supervisor.page.locator(".plate").get_by_text("Stopped", exact=True).wait_for()
        assert (await observer.stats())["stop"]["stopped"], "it is still stopped"
        await operator.reset()
        # Deadman and stick are held as they were when the switch was turned.
        rendered = (await operator.stats())["streams"]["overview"]["rendered"]
        await operator.until(f"s.streams.overview.rendered > {rendered + 10}")
        after = await operator.stats()
        assert (after["armed"], after["at_rest"]) == (False, True)
        await operator.pad.press(RB, False)
        await operator.arm()
        await operator.drive_forward()


async def _until_old(stack: Stack, number: int) -> None:
    """Until the bridge has fed back something a second after this stop."""
    async with asyncio.timeout(20):
        while True:
            since = next(each["time"] for each in await stack.events("stop") if each["number"] == number)
            if max(each["time"] for each in await stack.events("feedback")) > since + 1:
                return
            await asyncio.sleep(0.1)


LAMP = Axis(name="lamp", label="Lamp", unit="", minimum=0, maximum=1, slew=1000, brake=1000)
WARNS = "The robot warns the people near it: it may move in"
WARNING = StartWarning(seconds=2.0, axis="lamp", value=1.0)


class LampRobot(PlanarRobot):
    """Its lamp is lit before it moves."""

    def __init__(self) -> None:
        super().__init__()
        self.applied: list[tuple[bool, bool]] = []  # whether the lamp was lit, whether it was told to move; changes

    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(DESCRIPTION, axes=(*DESCRIPTION.axes, LAMP), start_warning=WARNING)

    def apply(self, values: Sequence[float]) -> None:
        *motion, lamp = values
        super().apply(motion)
        now = lamp == WARNING.value, any(motion)
        if not self.applied or self.applied[-1] != now:
            self.applied.append(now)

    def measure(self) -> Measurement:
        measured = super().measure()
        return measured._replace(axes=[*measured.axes, 0.0])


async def test_before_the_first_motion_the_robot_warns_and_the_page_counts_down(
    tmp_path: Path, chromium: Browser
) -> None:
    robot, log = LampRobot(), tmp_path / "events.jsonl"
    async with (
        Bridge(robot, BridgeSettings(port=0, event_log=log)) as bridge,
        running_console(tmp_path, f"tcp://127.0.0.1:{bridge.address[1]}", log) as stack,
        open_console(chromium, stack.operator) as operator,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        for page in (operator, observer):
            await page.until("s.connected && s.event !== null")
        assert robot.applied == [(False, False)]
        await operator.arm()
        for page in (operator, observer):
            await _warned(page).wait_for()
        await operator.drive_forward({1: -1})
        assert (await operator.stats())["armed"], "the warning has not disarmed"
        await _warned(operator).wait_for(state="hidden")
        at_work = [each for each in robot.applied if each != (False, False)]
        assert at_work[:2] == [(True, False), (False, True)], "it moved before or while it warned"


def _warned(console: ConsolePage) -> Locator:
    return console.page.locator(".alarm").get_by_text(WARNS)
