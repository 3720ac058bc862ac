"""Cases about STOP: its latch, its numbers, its reset."""

import secrets

from lockstep.protocol.messages import Reset
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.driver import BY
from lockstep.robot_bridge.conformance.errors import expect
from lockstep.robot_bridge.conformance.subject import Subject

__all__ = ["STOP_CASES"]


def _press() -> str:
    return secrets.token_hex(16)


async def _latches(subject: Subject) -> None:
    press = _press()
    async with subject.operator() as driver, subject.link("events") as (watcher, _):
        await driver.drive(driver.moving())
        number = await driver.stop(press, watcher)
        shown = await driver.heard(lambda feedback: feedback.stop.stopped, "stopped")
        expect((shown.stop.by, shown.stop.number) == (BY, number), "the stop state names another stop")
        await driver.heard(lambda feedback: feedback.at_rest, "at rest after a stop")
        for values in (driver.moving(), driver.neutral):
            await driver.refused(driver.command(values), "stopped")
        expect((await driver.fresh()).stop.stopped, "the stop was forgotten without a reset")
    async with subject.operator(armed=False) as driver:
        expect(driver.feedback.stop.stopped, "a new operator link released the stop")
        await driver.refused(driver.command(driver.neutral), "stopped")


async def _numbers(subject: Subject) -> None:
    one, other = _press(), _press()
    async with subject.operator() as driver, subject.link("media") as (watcher, _):
        numbers = [await driver.stop(press, watcher) for press in (one, other, one, "", "")]
        first, second, again, third, last = numbers
        expect(0 < first < second < third < last, f"each press needs a number above the last, not {numbers}")
        expect(again == first, f"a repeat of press {first} has the number {again}")
        shown = await driver.heard(lambda feedback: feedback.stop.number == last, f"the newest stop, {last}")
        expect(shown.stop.press == "", "the stop state has another press than the newest stop's")


async def _reset_names_one(subject: Subject) -> None:
    async with subject.operator() as driver:
        first = await driver.stop(_press())
        await driver.heard(lambda feedback: feedback.stop.number == first, f"stop {first}")
        await driver.refused(Reset(by=BY), "stale_reset")
        await driver.refused(Reset(by=BY, number=first), "too_soon")
        press = _press()
        second = await driver.stop(press)
        await driver.heard(lambda feedback: feedback.stop.number == second, f"stop {second}")
        expect(driver.feedback.stop.press == press, "the stop state has another press than the newest stop's")
        await driver.refused(Reset(by=BY, number=first), "stale_reset")
        expect(driver.feedback.stop.stopped, "a reset of an older stop released the newest")
        await driver.reset()


async def _reset_then_neutral(subject: Subject) -> None:
    async with subject.operator() as driver:
        press = _press()
        number = await driver.stop(press)
        await driver.heard(lambda feedback: feedback.stop.stopped, "stopped")
        await driver.reset()
        expect(driver.feedback.at_rest, "a reset moved the robot")
        await driver.refused(driver.command(driver.moving()), "not_neutral")
        again = await driver.stop(press)
        expect(again == number, f"a repeat of the press that was reset, {number}, is stop {again}")
        await driver.arm()
        expect(not driver.feedback.stop.stopped, "a repeat of a press that was reset stopped the robot again")
        await driver.drive(driver.moving())


STOP_CASES: tuple[Case, ...] = (
    Case("stop_latches", "STOP from any role latches, over links and commands", "Stop and reset", _latches),
    Case("stop_numbers", "each press has a number of its own, and its repeats the same", "Stop and reset", _numbers),
    Case(
        "reset_names_one",
        "a reset names the newest stop, and comes no sooner than 1 s after it",
        "Stop and reset",
        _reset_names_one,
    ),
    Case(
        "reset_then_neutral",
        "after a reset a neutral command comes before the first motion",
        "Before the first motion",
        _reset_then_neutral,
    ),
)
