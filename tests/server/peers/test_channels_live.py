"""The data channels, over real WebRTC, against a real bridge."""

import asyncio
from collections.abc import Iterator

import pytest

from lockstep.protocol.console import (
    Notice,
    Participants,
    Rename,
    Report,
    RobotState,
    Seat,
    SeatRelease,
    SeatRequest,
    ServerMessage,
    StopStateNotice,
    Welcome,
)
from lockstep.protocol.messages import Command, Feedback, Ping, Pong, Refusal, Reset, Rest, Stop
from lockstep.protocol.serial import event_after
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_table import SeatOutcome
from lockstep.server.peers.channels import MAX_MESSAGE
from tests.server.rig import PATIENCE, TestPeer, eventually, running_rig


async def _id(peer: TestPeer) -> str:
    welcome = await peer.until(lambda each: isinstance(each, Welcome))
    assert isinstance(welcome, Welcome)
    return welcome.peer


async def _reset_again(peer: TestPeer, number: int) -> None:
    """A bridge takes no reset within a second of a stop."""
    while True:
        peer.send("stop", Reset(number=number))
        await asyncio.sleep(0.3)


async def _take_seat(peer: TestPeer) -> None:
    """And send the neutral command that has to come first."""
    mine = await _id(peer)
    peer.send("session", SeatRequest())
    await peer.until(lambda each: isinstance(each, Seat) and each.holder == mine)
    await _drive(peer, 0.0)


async def _drive(peer: TestPeer, value: float, count: int = 1) -> Feedback:
    """Events one after the other, as fast as they are answered; this network loses nothing."""
    now = await peer.feedback()
    for _ in range(count):
        now = await peer.drive([value] + [0.0] * (len(now.axes) - 1))
    return now


async def _refused(peer: TestPeer, reason: str, detail: str = "") -> Refusal:
    def found(each: ServerMessage) -> bool:
        return isinstance(each, Refusal) and each.reason == reason and detail in each.detail

    message = await peer.until(found)
    assert isinstance(message, Refusal)
    return message


async def test_a_newcomer_is_told_all_there_is_to_know() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        for kind in (Welcome, RobotState, Seat, Participants, StopStateNotice, Feedback):
            await peer.until(lambda each, kind=kind: isinstance(each, kind))  # type: ignore[misc]
        session = [each for each in peer.heard if isinstance(each, Welcome | RobotState | Seat | Participants | Notice)]
        assert isinstance(session[0], Welcome)
        assert session[0].role == "observer"


async def test_an_operator_takes_the_seat_and_drives() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        await _take_seat(peer)
        first = peer.newest_feedback()
        last = await _drive(peer, 0.2, count=20)
        executed = last.event - first.event
        assert executed >= 20  # and a neutral one each time that a busy machine held the robot up
        assert not last.at_rest
        assert rig.count("lockstep_robot_turnaround_seconds_count") == executed + 1
        assert rig.count("lockstep_commands_total", outcome="forward") >= executed + 1


async def test_what_the_bridge_refuses_reaches_the_sender_and_the_way_is_free_again() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer, rig.peer("observer") as other:
        await _take_seat(peer)
        now = peer.newest_feedback()
        following = event_after(now.event)
        unknown = Command(event=following, issue=now.issue + 1000, values=[0.0] * len(now.axes))
        peer.send("control", unknown)
        assert (await _refused(peer, "late")).event == following
        assert rig.count("lockstep_refusals_total", reason="late") == 1
        await _drive(peer, 0.0)
        assert not any(isinstance(each, Refusal) for each in other.heard)


async def test_a_repeat_of_the_current_event_is_answered_again_and_executes_nothing() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        await _take_seat(peer)
        last = await _drive(peer, 0.0)
        peer.heard.clear()
        peer.send(
            "control", Command(event=last.event, issue=last.issue, nonce=last.nonce, values=[1.0] * len(last.axes))
        )
        await peer.feedback(lambda each: each.event == last.event)
        assert rig.count("lockstep_commands_total", outcome="answer") == 1
        assert (await rig.session())["event"] == last.event


async def test_letting_go_brings_the_robot_to_rest() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        await _take_seat(peer)
        await _drive(peer, 0.0)
        moving = await _drive(peer, 0.3, count=5)
        assert not moving.at_rest
        peer.send("control", Rest(event=event_after(moving.event)))
        await peer.feedback(lambda each: each.issue > moving.issue and each.at_rest)


async def test_a_second_operator_gets_the_seat_only_when_it_is_given_back() -> None:
    async with running_rig() as rig, rig.peer("operator") as first, rig.peer("operator") as second:
        await _take_seat(first)
        second.send("session", SeatRequest(only_if_free=True))
        await _refused(second, "seat_taken")
        first.send("session", SeatRelease())
        await second.until(lambda each: isinstance(each, Seat) and each.why == "released")
        await _take_seat(second)


async def test_an_observer_cannot_command_nor_rest_nor_take_the_seat_nor_reset() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        now = await peer.feedback()
        peer.send(
            "control",
            Command(event=event_after(now.event), issue=now.issue, nonce=now.nonce, values=[0.0] * len(now.axes)),
        )
        refusal = await _refused(peer, "no_seat")
        assert (refusal.event, refusal.current) == (event_after(now.event), now.event)
        peer.send("control", Rest(event=now.event))
        peer.send("session", SeatRequest())
        await _refused(peer, "not_allowed")
        peer.send("stop", Reset())
        await _refused(peer, "not_allowed", "observers may not reset a stop")
        assert (await rig.session())["seat"]["holder"] == ""
        assert (await rig.session())["event"] == now.event
        assert rig.count("lockstep_refusals_total", reason="no_seat") == 2
        assert rig.count("lockstep_refusals_total", reason="not_allowed") == 2


@pytest.mark.parametrize("channel", ["stop", "control", "session"])
async def test_an_observer_can_stop_from_any_channel_and_everyone_hears_it(channel: str) -> None:
    async with running_rig() as rig, rig.peer("operator") as driver, rig.peer("observer") as peer:
        await _take_seat(driver)
        await _drive(driver, 0.2, count=3)
        peer.send(channel, Stop(by="somebody else", reason="dog"))
        for each in (driver, peer):
            await each.until(lambda heard: isinstance(heard, StopStateNotice) and heard.stop.stopped)
        now = await driver.feedback(lambda each: each.stop.stopped)
        assert (now.stop.by, now.stop.reason) == ("observer", "dog")
        driver.send(
            "control",
            Command(event=event_after(now.event), issue=now.issue, nonce=now.nonce, values=[0.0] * len(now.axes)),
        )
        await _refused(driver, "stopped")
        asked = asyncio.get_running_loop().create_task(_reset_again(driver, now.stop.number))
        await peer.until(lambda heard: isinstance(heard, StopStateNotice) and not heard.stop.stopped)
        asked.cancel()
        assert rig.count("lockstep_stops_total", where=channel) == 1


@pytest.mark.parametrize("how", ["close", "channel", "release"])
async def test_when_the_driver_is_gone_the_robot_comes_to_rest(how: str) -> None:
    async with running_rig() as rig, rig.peer("observer") as watcher:
        async with rig.peer("operator") as driver:
            await _take_seat(driver)
            await _drive(driver, 0.0)
            moving = await _drive(driver, 0.3, count=10)
            assert not moving.at_rest
            if how == "channel":
                driver.channels["control"].close()
            elif how == "release":
                driver.send("session", SeatRelease())
            if how != "close":
                await watcher.until(lambda each: isinstance(each, Seat) and bool(each.why) and not each.holder)
        await watcher.until(lambda each: isinstance(each, Seat) and bool(each.why) and not each.holder)
        await watcher.feedback(lambda each: each.event >= moving.event and each.at_rest)
        assert (
            sum(rig.count("lockstep_rests_total", why=why) for why in ("disconnected", "released", "heartbeat lost"))
            == 1
        )


async def test_a_driver_who_falls_silent_loses_the_seat_and_stays_connected() -> None:
    async with running_rig(seat_timeout=0.4) as rig, rig.peer("operator") as driver:
        await _take_seat(driver)
        await driver.until(lambda each: isinstance(each, Seat) and each.why == "heartbeat lost")
        assert rig.count("lockstep_rests_total", why="heartbeat lost") == 1
        driver.send("control", Ping(id=1))
        await driver.until(lambda each: each == Pong(id=1))


async def test_malformed_messages_do_not_keep_the_seat() -> None:
    async with running_rig(seat_timeout=0.5) as rig, rig.peer("operator") as driver:
        await _take_seat(driver)
        async with asyncio.timeout(PATIENCE):
            while not any(isinstance(each, Seat) and each.why == "heartbeat lost" for each in driver.heard):
                driver.send_raw("session", "rubbish")
                await asyncio.sleep(0.1)


class _SeatClock:
    """Time of the control seat, which passes when the test says so. Notes when silent holders were looked for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        self.looked_at = 0.0
        expire = SeatRules.expire

        def look(rules: SeatRules, now: float) -> Iterator[SeatOutcome]:
            yield from expire(rules, now)
            self.looked_at = now

        monkeypatch.setattr(SeatRules, "expire", look)
        monkeypatch.setattr("lockstep.server.control.seat.seat_keeper.time", self)

    def monotonic(self) -> float:
        return self.now

    async def passes(self, seconds: float) -> None:
        self.now += seconds
        await eventually(lambda: self.looked_at == self.now)


async def test_reports_keep_the_seat(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = _SeatClock(monkeypatch)
    async with running_rig(seat_timeout=1.0) as rig, rig.peer("operator") as driver:
        await _take_seat(driver)
        [peer] = rig.webrtc_peers
        for number in range(1, 6):
            await clock.passes(0.9)
            driver.send("control", Report(event=number))
            await eventually(lambda wanted=number: peer.report.event == wanted)  # type: ignore[misc]
        await clock.passes(0.9)
        assert (await rig.session())["seat"]["holder"] == peer.id
        await clock.passes(10.0)
        await driver.until(lambda each: isinstance(each, Seat) and each.why == "heartbeat lost")


async def test_bad_input_is_answered_and_counted_by_name_and_disturbs_nobody() -> None:
    async with running_rig() as rig, rig.peer("operator") as driver, rig.peer("observer") as peer:
        await _take_seat(driver)
        inputs: list[tuple[str, str | bytes, str]] = [
            ("control", "rubbish", "malformed"),
            ("control", b"\x00\x01", "binary"),
            ("control", "x" * (MAX_MESSAGE + 1), "too_large"),
            ("control", '{"type":"seat_request"}', "wrong_channel"),
            ("session", '{"type":"command","event":1,"issue":1,"values":[]}', "wrong_channel"),
            ("stop", "", "malformed"),
        ]
        for channel, data, reason in inputs:
            before = rig.count("lockstep_bad_input_total", where=channel, reason=reason)
            peer.send_raw(channel, data)
            await _refused(peer, "malformed", f"{reason}: ")
            peer.heard.clear()
            assert rig.count("lockstep_bad_input_total", where=channel, reason=reason) == before + 1
        await _drive(driver, 0.1, count=3)


async def test_a_flood_is_cut_off_but_a_stop_within_it_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    # A busy machine may take seconds for the flood: nothing that it waits may refill the budget.
    monkeypatch.setattr("lockstep.server.peers.channels.TokenBucket", lambda rate, burst: TokenBucket(0.001, burst))
    async with running_rig(max_observer_rate=20) as rig, rig.peer("observer") as peer:
        for number in range(100):
            peer.send("session", Rename(name=str(number)))
        peer.send("stop", Stop(reason="now"))
        await peer.until(lambda each: isinstance(each, StopStateNotice) and each.stop.stopped)
        assert rig.count("lockstep_bad_input_total", where="session", reason="flood") >= 60


async def test_a_channel_that_does_not_exist_is_closed_and_so_is_a_second_one_of_a_name() -> None:
    async with running_rig() as rig:
        async with rig.peer("observer", "control", "gossip") as peer:
            async with asyncio.timeout(PATIENCE):
                await peer.closed.wait()
            assert rig.count("lockstep_bad_input_total", where="other", reason="unknown_channel") == 1
        async with rig.peer("observer", "control") as peer:
            peer.pc.createDataChannel("control")
            peer.send("control", Ping(id=1))
            await peer.until(lambda each: each == Pong(id=1))
        assert rig.count("lockstep_bad_input_total", where="other", reason="duplicate_channel") == 1


async def test_names_and_reports_reach_the_others() -> None:
    async with running_rig() as rig, rig.peer("operator") as driver, rig.peer("observer") as peer:
        driver.send("session", Rename(name="Ada\n\x00"))
        driver.send("control", Report(event=1, picture_delay_ms=42.0))

        def renamed(each: ServerMessage) -> bool:
            return isinstance(each, Participants) and any(
                (who.name, who.picture_delay_ms) == ("Ada", 42.0) for who in each.participants
            )

        await peer.until(renamed)
        await _take_seat(driver)
        await peer.until(lambda each: isinstance(each, Seat) and each.name == "Ada")
        driver.send("session", Rename(name="Grace"))
        await peer.until(lambda each: isinstance(each, Seat) and each.name == "Grace")


async def test_observers_get_feedback_at_a_bounded_rate_and_the_last_one_always() -> None:
    async with running_rig(observer_feedback_hz=2) as rig, rig.peer("operator") as driver, rig.peer("observer") as peer:
        await _take_seat(driver)
        last = await _drive(driver, 0.0, count=40)
        await peer.feedback(lambda each: each.event == last.event)
        events = {each.event for each in peer.heard if isinstance(each, Feedback)}
        assert len(events) <= 20


async def test_whoever_has_ended_is_told_nothing_more_while_the_connection_closes() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        await _id(peer)
        (there,) = rig.webrtc_peers
        there.end("link revoked")
        rig.dependencies.console.peers.announce(Notice(level="info", text="for those who are here"))
        there.send_feedback('{"type": "pong", "id": 77}')
        async with asyncio.timeout(PATIENCE):
            await peer.closed.wait()
        assert not [each for each in peer.heard if isinstance(each, Notice) or each == Pong(id=77)]
