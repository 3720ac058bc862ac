"""The control seat, names and notes over real data channels: what everyone is told, and when."""

import asyncio

import pytest

from lockstep.protocol.console import (
    Note,
    Participants,
    Rename,
    Seat,
    SeatGrant,
    SeatRelease,
    SeatRequest,
    SeatTake,
    ServerMessage,
    SharedNote,
    Welcome,
)
from lockstep.protocol.messages import Command, Feedback, Refusal, Reset
from lockstep.protocol.serial import event_after
from lockstep.server.control.seat.seat_keeper import LINK_CLAIMS
from tests.server.rig import TestPeer, eventually, running_rig


async def _id(peer: TestPeer) -> str:
    welcome = await peer.until(lambda each: isinstance(each, Welcome))
    assert isinstance(welcome, Welcome)
    return welcome.peer


async def _seat(peer: TestPeer, **state: object) -> Seat:
    """The first seat message that says so."""

    def found(each: ServerMessage) -> bool:
        return isinstance(each, Seat) and all(getattr(each, name) == value for name, value in state.items())

    message = await peer.until(found)
    assert isinstance(message, Seat)
    return message


async def _refused(peer: TestPeer, reason: str) -> Refusal:
    message = await peer.until(lambda each: isinstance(each, Refusal) and each.reason == reason)
    assert isinstance(message, Refusal)
    return message


async def test_a_claim_that_nobody_answers_counts_as_declined() -> None:
    async with (
        running_rig(seat_claim_seconds=0.4) as rig,
        rig.peer("operator") as first,
        rig.peer("operator") as second,
    ):
        holder = await _id(first)
        first.send("session", SeatRequest())
        await _seat(first, holder=holder)
        second.send("session", SeatRequest())
        claimed = await first.until(lambda each: isinstance(each, Seat) and bool(each.claims))
        assert isinstance(claimed, Seat)
        assert [(claim.peer, claim.name) for claim in claimed.claims] == [(await _id(second), "operator 2")]
        assert 0 < claimed.claims[0].seconds_left <= 0.4
        assert (await _refused(second, "declined")).detail == "no answer"
        assert rig.dependencies.console.seat.message().holder == holder
        assert not rig.dependencies.console.seat.message().claims


async def test_an_idle_driver_is_counted_down_for_everyone_and_loses_the_seat() -> None:
    async with (
        running_rig(seat_idle_seconds=1.5) as rig,
        rig.peer("operator") as driver,
        rig.peer("observer") as watcher,
    ):
        driver.send("session", SeatRequest())
        counting = await watcher.until(lambda each: isinstance(each, Seat) and each.idle_seconds_left is not None)
        assert isinstance(counting, Seat)
        assert counting.holder == await _id(driver)
        await _seat(watcher, holder="", why="idle")
        assert rig.count("lockstep_rests_total", why="idle") == 1


async def test_who_drives_is_not_idle() -> None:
    async with running_rig(seat_idle_seconds=1.5) as rig, rig.peer("operator") as driver:
        driver.send("session", SeatRequest())
        await _seat(driver, holder=await _id(driver))
        await driver.feedback()
        loop = asyncio.get_running_loop()
        begun, moving = loop.time(), 0.0
        while loop.time() - begun < 2.2:
            await driver.drive([moving] + [0.0] * (len(driver.newest_feedback().axes) - 1))
            moving = 0.1
        assert rig.dependencies.console.seat.state.holder == await _id(driver)


async def test_a_moving_command_of_a_new_driver_is_refused_until_a_neutral_one_came() -> None:
    async with running_rig() as rig, rig.peer("supervisor") as driver:
        driver.send("session", SeatTake())
        await _seat(driver, why="taken")
        now = await driver.feedback()
        following = event_after(now.event)
        driver.send(
            "control",
            Command(event=following, issue=now.issue, nonce=now.nonce, values=[0.2] + [0.0] * (len(now.axes) - 1)),
        )
        assert (await _refused(driver, "not_neutral")).event == following
        driver.send("control", Command(event=following, issue=now.issue, nonce=now.nonce, values=[0.0] * len(now.axes)))
        await driver.feedback(lambda each: each.event == following)
        assert rig.count("lockstep_refusals_total", reason="not_neutral") == 1


async def test_a_supervisor_resets_and_an_operator_does_not_take() -> None:
    async with running_rig() as rig, rig.peer("supervisor") as above, rig.peer("operator") as driver:
        above.send("session", SeatTake())
        await _seat(driver, why="taken")
        driver.send("session", SeatTake())
        await _refused(driver, "not_allowed")
        above.send("stop", Reset())
        await eventually(lambda: rig.count("lockstep_resets_total") == 1)


async def test_who_answers_without_holding_the_seat_is_told_so() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        peer.send("session", SeatGrant(peer=await _id(peer)))
        await _refused(peer, "no_seat")


async def test_requests_that_everyone_is_told_of_are_limited_and_a_release_never_is() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        for number in range(30):
            peer.send("session", Rename(name=f"name {number}"))
        await _refused(peer, "too_often")
        peer.send("session", Note(text="between"))
        await peer.until(lambda each: isinstance(each, SharedNote))
        refused = rig.count("lockstep_refusals_total", reason="too_often")
        for _ in range(30):
            peer.send("session", SeatRelease())
        peer.send("session", Note(text="behind"))
        await peer.until(lambda each: isinstance(each, SharedNote) and each.text == "behind")
        assert rig.count("lockstep_refusals_total", reason="too_often") == refused


async def test_a_note_reaches_everyone_with_its_event_and_newcomers_read_it() -> None:
    async with running_rig() as rig, rig.peer("observer") as writer, rig.peer("operator") as reader:
        await writer.feedback()
        writer.send("session", Note(text="mind the\nstep"))
        note = await reader.until(lambda each: isinstance(each, SharedNote))
        assert isinstance(note, SharedNote)
        assert (note.text, note.name, note.peer) == ("mind the step", "observer", await _id(writer))
        assert (note.epoch, note.event) == (rig.dependencies.console.clock.epoch, rig.dependencies.console.clock.event)
        async with rig.peer("observer") as late:
            await late.until(lambda each: each == note)
        kept = [record for record in rig.dependencies.audit if record.kind == "note"]
        assert [(record.who, record.detail, record.event) for record in kept] == [
            ("observer", "mind the step", note.event)
        ]


async def test_the_first_to_come_keeps_the_name_and_who_leaves_makes_room() -> None:
    async with running_rig() as rig, rig.peer("operator") as second_name:
        async with rig.peer("observer") as first, rig.peer("observer") as second:
            for peer in (first, second):
                peer.send("session", Rename(name="Ada"))
                await peer.until(
                    lambda each: isinstance(each, Participants) and any(who.name == "Ada" for who in each.participants)
                )

            def both(each: ServerMessage) -> bool:
                return isinstance(each, Participants) and {"Ada", "Ada 2"} <= {who.name for who in each.participants}

            await second_name.until(both)
            await first.close()
            second_name.heard.clear()

            def one(each: ServerMessage) -> bool:
                return isinstance(each, Participants) and [
                    who.name for who in each.participants if who.role == "observer"
                ] == ["Ada"]

            await second_name.until(one)
        renamed = [record.who for record in rig.dependencies.audit if record.kind == "renamed"]
        assert renamed == ["Ada", "Ada 2"]


@pytest.mark.parametrize("role", ["operator", "supervisor"])
async def test_those_who_may_drive_get_every_feedback(role: str) -> None:
    async with running_rig(observer_feedback_hz=1) as rig, rig.peer("operator") as driver, rig.peer(role) as other:  # type: ignore[arg-type]
        driver.send("session", SeatRequest())
        await driver.feedback()
        for _ in range(20):
            await driver.drive([0.0] * len(driver.newest_feedback().axes))
        last = driver.newest_feedback().event
        await other.feedback(lambda each: each.event == last)
        events = {each.event for each in other.heard if isinstance(each, Feedback)}
        assert len(events) >= 20


async def test_one_link_does_not_take_all_places_of_those_who_ask_for_the_seat() -> None:
    async with running_rig() as rig, rig.peer("operator") as holder, rig.peer("operator") as another:
        holder.send("session", SeatRequest())
        await _seat(holder, holder=await _id(holder))
        greedy, headers = [TestPeer() for _ in range(LINK_CLAIMS + 1)], rig.token("operator")
        try:
            for peer in greedy:
                await peer.join(rig, headers, ("control", "session", "stop"))
                peer.send("session", SeatRequest())
            refused = await _refused(greedy[-1], "seat_taken")
            assert "your link" in refused.detail
            another.send("session", SeatRequest())
            wanted = await _id(another)
            seat = await holder.until(
                lambda each: isinstance(each, Seat) and wanted in [claim.peer for claim in each.claims]
            )
            assert isinstance(seat, Seat)
            assert len(seat.claims) == LINK_CLAIMS + 1
        finally:
            for peer in greedy:
                await peer.close()
