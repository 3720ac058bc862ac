"""Drives by the page in Chromium: with an emulated gamepad, or with the controllers of an emulated headset.

It knows what a person sees on the page: measured values, the goals that the robot applies and those that the page
commands, and how late the answers come. It answers with sticks, buttons and hands, never with a command.
"""

import asyncio
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from typing import Any, Final

from playwright.async_api import Error

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.headset_page import Headset, open_headset
from lockstep.bench.browsers.pad import RB, START
from lockstep.bench.experiment.browser import robot_description
from lockstep.bench.pick_place.controller_hand import ControllerHand
from lockstep.bench.pick_place.operator import OperatorFailed, PageHandName, Pictures
from lockstep.bench.pick_place.pad_hand import DPAD, SLOW_SHARE, PadHand, PadMove, gain_for
from lockstep.bench.pick_place.script import Hand, PickAndPlace, ToolHand
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback

__all__ = ["PageOperator", "page_operator"]

LOOK_SECONDS: Final = 0.05
CONNECT_SECONDS: Final = 60.0
ARM_SECONDS: Final = 90.0  # a bad network takes the robot away for a while
ARM_TRY_SECONDS: Final = 3.0
ENTER_TRIES: Final = 3
SLOW = 4  # W3C standard mapping
HEADSET_WINDOW = (1000, 220)  # both eyes: where the processor draws, each pixel costs
LOOK = "() => ({ page: window.lockstep.stats(), at: window.lockstep.feedbacks().at(-1)?.at ?? null })"
MOVE_PAD = """({ tilts, pulls, presses }) => {
  for (const [axis, value] of tilts) window.testPad.tilt(axis, value);
  for (const [button, value] of pulls) window.testPad.pull(button, value);
  for (const [button, pressed] of presses) window.testPad.press(button, pressed);
}"""
MOVE_HAND = """({ position, turned, triggers }) => {
  const h = window.testHeadset;
  h.turn("right", position, turned);
  for (const [at, side] of ["left", "right"].entries())
    h.device.controllers[side].updateButtonValue("trigger", triggers[at]);
}"""
IN_BOWL = "document.querySelector('[data-item=bowl] .status-value')?.textContent"
TAKE_SEAT = """() => [...document.querySelectorAll("button")]
  .find((each) => each.textContent.trim() === "Request control" && !each.disabled && each.offsetParent)?.click()"""
NOTHING: Final = PadMove()


class PageOperator(ABC):
    """What both hands have in common: they look, move and look again, and arm anew where the page has disarmed."""

    longest = 120.0  # a person who sees the arm late moves it slowly
    longest_block = 600.0

    def __init__(self, console: ConsolePage, description: RobotDescription) -> None:
        self.console = console
        self.description = description

    @abstractmethod
    def hand(self) -> Hand: ...

    @abstractmethod
    async def arm(self) -> None:
        """Arm once, with everything let go before; it may be refused."""

    @abstractmethod
    async def why_disarmed(self, seen: Mapping[str, Any]) -> str: ...

    @abstractmethod
    async def let_go(self) -> None: ...

    @abstractmethod
    async def follow(self, wanted: Mapping[str, float], feedback: Feedback, seen: Mapping[str, Any]) -> None:
        """Move the hand towards goals by what the page shows now."""

    async def reset_scene(self) -> None:
        await self.console.page.get_by_role("button", name="Reset scene", exact=True).click()

    async def until_in_bowl(self, count: int) -> None:
        await self.console.until(f"{IN_BOWL} === '{count}'", CONNECT_SECONDS)

    async def pictures(self) -> Pictures:
        streams = (await self.console.stats())["streams"].values()
        return Pictures(sum(each["rendered"] for each in streams), sum(each["violations"] for each in streams))

    async def operate(self, task: PickAndPlace, held_up: Counter[str]) -> None:
        event: int | None = None
        wanted: dict[str, float] = {}
        try:
            await self._until_armed()
            while True:
                look = await self.console.page.evaluate(LOOK)
                seen, feedback = look["page"], self._feedback(look)
                if not seen["armed"]:
                    held_up[await self.why_disarmed(seen)] += 1
                    await self._until_armed()
                    continue
                if feedback.event != event:
                    event, wanted = feedback.event, self._wanted(task, feedback)
                    if task.done or task.failed:
                        return
                await self.follow(wanted, feedback, seen)
                await asyncio.sleep(LOOK_SECONDS)
        except (Error, AssertionError) as error:
            raise OperatorFailed(f"the page failed: {error}") from error
        finally:
            with suppress(Error):
                await self.let_go()

    def _wanted(self, task: PickAndPlace, feedback: Feedback) -> dict[str, float]:
        values = zip(self.description.axes, task.values(feedback), strict=True)
        return {axis.name: value for axis, value in values if value is not None}

    def _feedback(self, look: Mapping[str, Any]) -> Feedback:
        """Return what the page shows as a feedback; its time is that of its arrival."""
        page = look["page"]
        return Feedback(
            event=page["event"],
            issue=1,
            time=look["at"] / 1000,
            axes=[page["axes"][axis.name] or 0.0 for axis in self.description.axes],
            goals=[page["goals"].get(axis.name) for axis in self.description.axes],
            faults=page["faults"],
            limits=page["limits"],
        )

    async def _until_armed(self) -> None:
        try:
            async with asyncio.timeout(ARM_SECONDS):
                while True:
                    await self.let_go()
                    await self.console.page.evaluate(TAKE_SEAT)
                    with suppress(AssertionError):
                        await self.console.until("s.seat?.mine && s.event !== null", ARM_TRY_SECONDS)
                        await self.arm()
                        await self.console.until("s.armed", ARM_TRY_SECONDS)
                        return
        except TimeoutError:
            why = await self.why_disarmed(await self.console.stats())
            raise OperatorFailed(f"the page does not arm for {ARM_SECONDS:g} s: {why}") from None


class PadOperator(PageOperator):
    """Holds the deadman all the time; sticks, cross and triggers do the rest."""

    def hand(self) -> Hand:
        self._hand = PadHand(self.description)
        return self._hand

    async def slow_down(self) -> None:
        """Let the slow button be slow enough for small turns, on the pads' sheet."""
        page = self.console.page
        await page.keyboard.press("KeyG")
        await page.get_by_role("slider", name="Slow", exact=True).fill(str(round(100 * SLOW_SHARE)))
        await page.get_by_role("button", name="Close").click()

    async def arm(self) -> None:
        await self.console.pad.press(START)
        await self.console.until("s.armed", ARM_TRY_SECONDS)
        await self.console.pad.press(START, False)
        await self.console.pad.press(RB)

    async def why_disarmed(self, seen: Mapping[str, Any]) -> str:
        await self.console.until("document.querySelector('.arm').dataset.state === 'disarmed'")  # it is drawn later
        return await self.console.page.locator(".arm-words").text_content() or ""

    async def let_go(self) -> None:
        await self._do(NOTHING, [RB, START])

    async def follow(self, wanted: Mapping[str, float], feedback: Feedback, seen: Mapping[str, Any]) -> None:
        await self._do(self._hand.move(wanted, feedback, gain_for(_delay(seen))))

    async def _do(self, move: PadMove, released: list[int] | None = None) -> None:
        cross = [button for pair in DPAD.values() for button in pair]
        presses = [(button, button in move.pressed) for button in cross]
        presses += [(SLOW, move.slow), *((button, False) for button in released or ())]
        done = {
            "tilts": [(axis, move.sticks.get(axis, 0.0)) for axis in range(4)],
            "pulls": [(button, move.triggers.get(button, 0.0)) for button in (6, 7)],
            "presses": presses,
        }
        await self.console.page.evaluate(MOVE_PAD, done)


class HeadsetOperator(PageOperator):
    """Squeezes the right controller and moves it; its trigger opens the gripper, the left one closes it."""

    def __init__(self, headset: Headset, description: RobotDescription) -> None:
        super().__init__(headset.console, description)
        self._headset = headset
        self._controller = ControllerHand()

    def hand(self) -> Hand:
        return ToolHand(self.description)

    async def reset_scene(self) -> None:
        """Press the window's button, which the session does not show."""
        await self.console.page.evaluate(
            "document.querySelector('.action[data-action=reset_scene] .action-button').click()"
        )

    async def arm(self) -> None:
        """Squeeze; in a session that has ended, as by a trigger that met its button, begin a new one first."""
        if not await self._is_worn():
            await self.console.page.evaluate("testHeadset.silence(false)")
            await self._headset.enter()
        await self._headset.squeeze()

    async def why_disarmed(self, seen: Mapping[str, Any]) -> str:
        if seen["headset"] is None:
            return "the session ended"
        with suppress(AssertionError):  # it is drawn later
            await self.console.until("s.headset?.state === 'Disarmed'", ARM_TRY_SECONDS)
        headset = (await self.console.stats())["headset"]
        return "the session ended" if headset is None else str(headset["text"])

    async def _is_worn(self) -> bool:
        return (await self.console.stats())["headset"] is not None

    async def let_go(self) -> None:
        if not await self._is_worn():
            return
        for button in ("squeeze", "trigger"):
            for side in ("left", "right"):
                await self._headset.press(side, button, 0)

    async def follow(self, wanted: Mapping[str, float], feedback: Feedback, seen: Mapping[str, Any]) -> None:
        move = self._controller.move(wanted, seen["commanded"], seen["goals"], gain_for(_delay(seen)))
        done = {"position": move.position, "turned": move.turned, "triggers": move.triggers}
        await self.console.page.evaluate(MOVE_HAND, done)


def _delay(seen: Mapping[str, Any]) -> float:
    """Return how late the hand sees what it did, s: an event's way there and back, and until the next one."""
    return 2 * (seen["command_to_feedback_ms"]["median"] or 0.0) / 1000


@asynccontextmanager
async def page_operator(link: str, near_link: str, name: PageHandName) -> AsyncIterator[PageOperator]:
    """Open the page in a Chromium of its own, with pictures of both cameras, and take the seat.

    `near_link`: past the network.

    Raises:
        AssertionError: the page does not come up; it says why.
    """
    description = await robot_description(near_link)
    async with running_chromium() as browser:
        if name == "pad":
            async with open_console(browser, link) as console:
                await console.until_live()
                operator = PadOperator(console, description)
                await operator.slow_down()
                yield operator
        else:
            width, height = HEADSET_WINDOW
            async with open_headset(browser, link, width=width, height=height) as headset:
                await headset.enter()
                await headset.place("left", [-0.3, 1.0, -0.3], up=1.2)  # points at no button of the view
                yield HeadsetOperator(headset, description)
