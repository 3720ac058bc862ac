"""The control seat between real clients, in mid-drive. The bridge's own log is the judge of what the robot was told."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import CommandRefused, Console, SeatRefused
from lockstep.protocol.serial import event_after
from tests.client.live.truth import until_logged
from tests.support.stack import Stack
from tests.waiting import PATIENCE

pytestmark = pytest.mark.asyncio(loop_scope="module")

FIRST = [0.2, 0.0, 0.0]  # what each driver sends tells the log who drove
SECOND = [0.0, 0.1, 0.0]
NEUTRAL = [0.0, 0.0, 0.0]


def _console(link: str, name: str) -> Console:
    return Console(link, video=False, audio=False, name=name)


async def _drive_until_refused(console: Console, values: list[float]) -> str:
    """As a person who does not let go; the reason of the refusal."""
    try:
        while True:
            await drive_on(console, values)
    except CommandRefused as refused:
        return refused.reason


async def _until(console: Console, condition: Any) -> None:
    """Until what the console was told meets `condition`; feedback comes twice a second at least."""
    async with asyncio.timeout(PATIENCE):
        async for _ in console.feedbacks():
            if condition():
                return


@asynccontextmanager
async def _two(stack: Stack, second: str) -> AsyncIterator[tuple[Console, Console]]:
    async with AsyncExitStack() as consoles:
        first = await consoles.enter_async_context(_console(stack.operator, "Ada"))
        yield first, await consoles.enter_async_context(_console(second, "Grace"))


async def _hand_over(how: str, first: Console, second: Console) -> None:
    """The second gets the seat while the first goes on driving."""
    if how == "taken":
        await second.take_seat()
        return
    asking = asyncio.create_task(second.request_seat())
    await _until(first, lambda: bool(first.seat.claims))
    assert first.seat.claims[0].name == "Grace"
    if how == "granted":
        first.grant(first.seat.claims[0].peer)
    else:
        first.release_seat()
    await asking


@pytest.mark.parametrize("how", ["granted", "taken", "released"])
async def test_in_a_hand_over_in_mid_drive_nothing_moves_between_the_two_drivers(stack: Stack, how: str) -> None:
    async with _two(stack, stack.supervisor if how == "taken" else stack.operator) as (first, second):
        await first.take_seat()
        await drive_on(first, FIRST)
        driving = asyncio.create_task(_drive_until_refused(first, FIRST))
        await _hand_over(how, first, second)
        last = [await drive_on(second, SECOND) for _ in range(10)][-1]
        assert await driving == "no_seat"
        assert (second.seat.holder, second.seat.name, second.seat.why) == (second.peer, "Grace", how)
        await until_logged(stack, "feedback", lambda record: record["event"] >= last.event)
    records = [record for record in await stack.records() if record["kind"] in ("executed", "rest")]
    executed = [record for record in records if record["kind"] == "executed"]
    begin = next(
        i for i, record in enumerate(records) if record.get("values") == SECOND and record["event"] > last.event - 10
    )
    before = records[:begin]
    let_go = max(i for i, record in enumerate(before) if record["kind"] == "rest")
    assert any(record.get("values") == FIRST for record in before[:let_go])
    between = [record["values"] for record in before[let_go + 1 :]]
    assert between, "the new driver's neutral command comes first"
    assert all(values == NEUTRAL for values in between)
    assert not any(record.get("values") == FIRST for record in records[begin:]), "the first driver is out"
    events = [record["event"] for record in executed]
    assert all(following == event_after(event) for event, following in zip(events, events[1:], strict=False)), (
        "s goes on"
    )


async def test_a_request_that_is_declined_changes_nothing_for_the_driver(stack: Stack) -> None:
    async with _two(stack, stack.operator) as (first, second):
        await first.take_seat()
        driving = asyncio.create_task(_drive_until_refused(first, FIRST))
        asking = asyncio.create_task(second.request_seat())
        await _until(first, lambda: bool(first.seat.claims))
        first.decline(second.peer)
        with pytest.raises(SeatRefused, match="declined"):
            await asking
        assert second.seat.holder == first.peer
        assert not second.seat.claims
        first.release_seat()
        assert await driving == "no_seat"


async def test_a_request_that_is_cancelled_is_withdrawn(stack: Stack) -> None:
    async with _two(stack, stack.operator) as (first, second):
        await first.take_seat()
        asking = asyncio.create_task(second.request_seat())
        await _until(first, lambda: bool(first.seat.claims))
        asking.cancel()
        await _until(first, lambda: not first.seat.claims)
        assert first.seat.holder == first.peer


async def test_a_driver_who_vanishes_is_succeeded_by_who_asked(stack: Stack) -> None:
    async with AsyncExitStack() as leaving, _console(stack.operator, "Grace") as second:
        first = await leaving.enter_async_context(_console(stack.operator, "Ada"))
        await first.take_seat()
        await drive_on(first, FIRST)
        asking = asyncio.create_task(second.request_seat())
        await _until(first, lambda: bool(first.seat.claims))
        await leaving.aclose()
        async with asyncio.timeout(PATIENCE):
            await asking
        assert second.seat.holder == second.peer
        assert (await drive_on(second, SECOND)).event > 0


async def test_an_observer_asks_in_vain_and_an_operator_takes_nothing(stack: Stack) -> None:
    async with _two(stack, stack.observer) as (first, second):
        await first.take_seat()
        with pytest.raises(SeatRefused, match="not_allowed"):
            await second.request_seat()
        assert (first.role, second.role) == ("operator", "observer")


async def test_everyone_sees_who_is_here_and_reads_the_notes(stack: Stack) -> None:
    async with _two(stack, stack.observer) as (first, second), _console(stack.operator, "Ada") as third:
        await first.take_seat()
        event = (await drive_on(first, NEUTRAL)).event
        note = await second.note("mind the \x00step\n")
        assert (note.text, note.name, note.role) == ("mind the step", "Grace", "observer")
        assert note.event >= event
        await _until(third, lambda: note in third.notes)
        everyone = {"Ada": "operator", "Ada 2": "operator", "Grace": "observer"}
        await _until(third, lambda: {each.name: each.role for each in third.participants} == everyone)
        await _until(first, lambda: all(each.round_trip_ms is not None for each in first.participants))
    async with _console(stack.observer, "late") as late:
        await _until(late, lambda: [each.text for each in late.notes] == ["mind the step"])


async def test_notes_that_nobody_could_read_any_more_are_refused(stack: Stack) -> None:
    async with _console(stack.operator, "chatty") as console:
        for number in range(5):
            await console.note(f"note {number}")
        with pytest.raises(CommandRefused, match="too_often"):
            await console.note("one more")
        with pytest.raises(CommandRefused, match="malformed"):
            await console.note("\x00")
