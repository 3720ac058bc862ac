"""Cases about commands: which one executes, and why."""

import asyncio
import math

from lockstep.protocol.messages import Command
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.driver import Driver
from lockstep.robot_bridge.conformance.errors import expect
from lockstep.robot_bridge.conformance.subject import Subject
from lockstep.robot_bridge.conformance.waiting import PATIENCE, within

__all__ = ["EVENT_CASES"]

COPIES = 5
UNKNOWN = 1000  # issues beyond the newest
REPEAT_EVERY = 0.02  # s
REFRESH = 0.5  # s between issues while nothing is commanded
REFRESH_LATE = 1.0  # s by which a busy robot may be late with it
AGED = 0.05  # s beyond max_event_age


async def _executes(subject: Subject) -> None:
    async with subject.operator() as driver:
        before = driver.feedback.event
        after = await driver.drive(driver.neutral)
        expect(after.event == event_after(before), f"event {after.event} follows event {before}")


async def _repeat(subject: Subject) -> None:
    async with subject.operator() as driver:
        await driver.drive(driver.moving())
        for _ in range(3):
            command = await driver.execute(driver.moving())
            driver.peer.send(command)
            await _stored(driver, command)


async def _stored(driver: Driver, repeated: Command) -> None:
    """Wait for a feedback that was there before. The bridge may measure again at any time; that is a new issue."""
    known = {driver.feedback.issue: driver.feedback}
    async with within(PATIENCE, f"a repeat of event {repeated.event} was not answered with the stored feedback"):
        while True:
            again = await driver.fresh()
            expect(again.event == repeated.event, f"a repeat of event {repeated.event} made event {again.event}")
            stored = known.setdefault(again.issue, again)
            if stored is again:
                continue
            same = (again.nonce, again.time) == (stored.nonce, stored.time)
            expect(same, "a repeat was answered with another feedback than the stored one")
            return


async def _copies(subject: Subject) -> None:
    async with subject.operator() as driver:
        command = await driver.execute(driver.moving(), copies=COPIES)
        after = await driver.drive(driver.neutral)
        expect(after.event == event_after(command.event), f"{COPIES} copies made more than one event")


async def _repeats_hold_nothing(subject: Subject) -> None:
    async with subject.operator() as driver:
        command = await driver.execute(driver.moving())
        moved = driver.feedback
        longest = driver.description.hold + subject.settle
        async with within(longest + PATIENCE, "the state is not measured again while a command is repeated"):
            while not (driver.feedback.at_rest and driver.feedback.issue > 1):
                expect(driver.feedback.time - moved.time < longest, "the robot goes on while one command is repeated")
                driver.peer.send(command)
                await driver.fresh()
                expect(driver.feedback.event == moved.event, "a repeat made an event of its own")
                await asyncio.sleep(REPEAT_EVERY)


async def _out_of_order(subject: Subject) -> None:
    async with subject.operator() as driver:
        command = driver.command(driver.neutral)
        far = Command(event=event_after(command.event), issue=command.issue, values=command.values, nonce=command.nonce)
        refusal = await driver.refused(far, "out_of_order")
        expect(refusal.current == driver.feedback.event, f"the refusal says that event {refusal.current} is current")
        await driver.drive(driver.neutral)


async def _late(subject: Subject) -> None:
    async with subject.operator() as driver:
        age, before = driver.description.max_event_age, driver.feedback
        await driver.heard(
            lambda feedback: feedback.time - before.time > age + AGED, "the passing of max_event_age", age + PATIENCE
        )
        values = driver.moving()
        late = Command(event=event_after(before.event), issue=before.issue, values=values, nonce=before.nonce)
        for _ in range(2):  # as two copies of one command that a network held up
            issue = driver.feedback.issue
            await driver.refused(late, "late")
            expect((await driver.fresh()).issue > issue, "no fresh issue after late")
        await driver.drive(values)


async def _unknown_issue(subject: Subject) -> None:
    async with subject.operator() as driver:
        await driver.refused(driver.command(driver.neutral, issue=driver.feedback.issue + UNKNOWN), "late")


async def _unseen(subject: Subject) -> None:
    async with subject.operator() as driver:
        for nonce in (0, driver.feedback.nonce ^ 1):
            await driver.refused(driver.command(driver.neutral, nonce=nonce), "unseen")


async def _nonces(subject: Subject) -> None:
    async with subject.operator() as driver:
        seen = [driver.feedback.nonce]
        for _ in range(3):
            seen.append((await driver.drive(driver.neutral)).nonce)
            seen.append((await driver.fresh()).nonce)
        expect(0 not in seen and len(set(seen)) == len(seen), "a nonce is 0, or the same in two issues")


async def _wrong_size(subject: Subject) -> None:
    async with subject.operator() as driver:
        for values in ([], [*driver.neutral, 0.0]):
            await driver.refused(driver.command(values), "wrong_size")
        await driver.drive(driver.neutral)


async def _not_a_number(subject: Subject) -> None:
    async with subject.operator() as driver:
        for value in (math.nan, math.inf, -math.inf):
            await driver.refused(driver.command([value, *driver.neutral[1:]]), "not_a_number")
        await driver.drive(driver.neutral)


async def _refresh(subject: Subject) -> None:
    async with subject.operator() as driver:
        before = driver.feedback
        for _ in range(2):
            after = await driver.fresh()
            expect(after.event == before.event, "the event changed, and nothing was commanded")
            expect(after.issue == before.issue + 1, f"issue {after.issue} follows issue {before.issue}")
            expect(0 < after.time - before.time < REFRESH + REFRESH_LATE, "not measured again every 0.5 s")
            before = after


EVENT_CASES: tuple[Case, ...] = (
    Case("executes", "the next command executes as the next event", "The event reference", _executes),
    Case("repeat", "a repeat executes nothing and gets the stored feedback", "What happens to a command", _repeat),
    Case("copies", "copies that come at once execute once", "What happens to a command", _copies),
    Case(
        "repeats_hold_nothing",
        "repeats do not extend the time that a command is held",
        "Hold",
        _repeats_hold_nothing,
    ),
    Case("out_of_order", "an event beyond the next is refused", "What happens to a command", _out_of_order),
    Case(
        "late",
        "a command that answers a feedback older than max_event_age is refused, and a fresh issue follows",
        "What happens to a command",
        _late,
    ),
    Case(
        "unknown_issue",
        "a command that answers an issue that never was is refused",
        "What happens to a command",
        _unknown_issue,
    ),
    Case("unseen", "a command without the nonce of its issue is refused", "What a command has seen", _unseen),
    Case("nonces", "every issue has a nonce of its own, and none is 0", "What a command has seen", _nonces),
    Case("wrong_size", "a command needs one value per axis", "What happens to a command", _wrong_size),
    Case("not_a_number", "a value that is NaN or infinite is refused", "What happens to a command", _not_a_number),
    Case(
        "refresh",
        "while nothing is commanded the feedback comes again every 0.5 s, with the next issue",
        "Issues, and why a command names one",
        _refresh,
    ),
)
