"""The life of a STOP at the console, with a robot that answers when the test says so."""

import asyncio
import time
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any, cast

import pytest
from structlog.testing import capture_logs

from lockstep.protocol.console import Notice, Role, ServerMessage
from lockstep.protocol.messages import Feedback, Refusal, RefusalReason, Reset, Stop, StopState, StopTaken
from lockstep.server.audit.audit_tail import AuditTail
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor, AuditRecord
from lockstep.server.auth.silenced_links import SILENCE_SECONDS
from lockstep.server.auth.tokens import Identity
from lockstep.server.control import stop_service
from lockstep.server.control.notices import Notices
from lockstep.server.control.session_audit import STOPS, SessionAudit
from lockstep.server.control.stop_service import StopService
from lockstep.server.errors import (
    ConsoleError,
    LinkDown,
    LockedOut,
    NoSeat,
    NotAllowed,
    ResetTooSoon,
    Silenced,
    StaleReset,
    TooManyRequests,
    Unconfirmed,
)
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import SessionEvents
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import Press, new_press
from lockstep.server.telemetry.metrics import Metrics
from tests.server.rig import PATIENCE


class FakeRobot:
    def __init__(self) -> None:
        self.up = True
        self.media_up = False
        self.detail = "no bridge"
        self.sent: list[Stop | Reset] = []

    def send(self, message: Reset) -> bool:
        if self.up:
            self.sent.append(message)
        return self.up

    def send_stop(self, stop: Stop) -> bool:
        if self.up or self.media_up:
            self.sent.append(stop)
        return self.up or self.media_up


class FakePeer:
    def __init__(self, name: str, role: Role) -> None:
        self.id = f"{name}-1"
        self.name = name
        self.role = role
        self.identity = Identity(role, name, f"link of {name}", 1e12)
        self.silenced = False
        self.told: list[ServerMessage] = []

    @property
    def actor(self) -> Actor:
        return Actor(self.name, self.role, self.id, self.identity.token_id)

    def send(self, channel: str, message: ServerMessage) -> None:
        self.told.append(message)


class FakePeers:
    def __init__(self) -> None:
        self.all = {
            name: FakePeer(name, role)
            for name, role in cast(
                list[tuple[str, Role]],
                [("ann", "operator"), ("bob", "operator"), ("olga", "observer"), ("sue", "supervisor")],
            )
        }
        self.told: list[ServerMessage] = []

    def __iter__(self) -> Iterator[FakePeer]:
        return iter(self.all.values())

    def by_id(self, peer_id: str) -> FakePeer | None:
        return next((peer for peer in self if peer.id == peer_id), None)

    def tell(self, channel: str, message: ServerMessage) -> None:
        self.told.append(message)

    def announce(self, message: ServerMessage) -> None:
        self.told.append(message)


class Bench:
    """Ann holds the seat; the link is up."""

    def __init__(self, directory: Path) -> None:
        self.robot, self.peers, self.clock, self.tail = FakeRobot(), FakePeers(), EventClock(), AuditTail()
        self.keeper = StopKeeper(directory, "tcp://robot:1")
        self.directory = directory
        self.holder = "ann-1"
        self.issue = 0
        self.audit = AuditTrail(self.clock, self.tail)
        self.notices = Notices(cast(PeerRegistry, self.peers))
        events = SessionEvents(Metrics(process=False).faults)
        SessionAudit(self.audit).subscribe(events)
        self.notices.subscribe(events)
        self.service = StopService(
            self.robot,
            self.keeper,
            cast(PeerRegistry, self.peers),
            self.clock,
            lambda: self.holder,
            events,
        )

    def press(self, who: str, id_: str, where: str = "stop") -> Press:
        press = Press(id=id_, by=self.peers.all[who].actor, where=where, reason="smoke")
        self.service.stop(press)
        return press

    def take(self, id_: str, number: int, *, kept: bool = True) -> None:
        self.service.taken(StopTaken(press=id_, number=number, kept=kept))

    def show(self, stop: StopState) -> None:
        self.issue += 1
        feedback = Feedback(event=1, issue=self.issue, time=0.0, axes=[], stop=stop)
        assert self.clock.observe(feedback, 0.0)
        self.service.feedback(stop)

    def stopped(self, number: int) -> None:
        self.show(StopState(stopped=True, number=number))

    def lose(self) -> None:
        self.robot.up = False
        self.service.link_down("gone")

    def reset(self, who: str, number: int, *, peer: bool = False) -> "asyncio.Task[None]":
        actor = self.peers.all[who].actor
        by = actor if peer else actor._replace(peer="")
        return asyncio.create_task(self.service.reset(by, "http", number))

    def records(self, kind: str) -> list[AuditRecord]:
        self.audit.flush()
        return [record for record in self.tail if record.kind == kind]

    def heard(self, who: str, kind: type[Any]) -> list[Any]:
        return [message for message in self.peers.all[who].told if isinstance(message, kind)]

    @property
    def on_disk(self) -> int:
        return len(list(self.directory.rglob("*.json")))


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    made = Bench(tmp_path)
    parts = (made.keeper.run, made.service.run, made.service.watch_disk)
    tasks = [asyncio.create_task(part()) for part in parts]
    yield made
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def _raised(reset: "asyncio.Task[None]") -> type[ConsoleError]:
    with pytest.raises(ConsoleError) as caught:
        async with asyncio.timeout(PATIENCE):
            await reset
    return type(caught.value)


# STOP


async def test_a_stop_is_delivered_only_when_the_robot_has_answered_with_its_number(bench: Bench) -> None:
    bench.press("olga", "p")
    waiting = asyncio.create_task(bench.service.outcome("p"))
    await asyncio.sleep(0)
    bench.stopped(7)
    await asyncio.sleep(0)
    assert not waiting.done(), "what a feedback shows may be somebody else's stop"
    bench.take("p", 7)
    outcome = await waiting
    assert (outcome.delivered, outcome.number, outcome.press) == (True, 7, "p")
    assert bench.heard("olga", StopTaken) == [StopTaken(press="p", number=7)]
    assert bench.heard("ann", StopTaken) == []
    (record,) = bench.records("stop")
    assert (record.who, record.what, record.detail) == ("olga", "stop, stop 7", "smoke")


def test_a_stop_by_http_has_the_name_of_the_only_person_who_has_its_link(bench: Bench) -> None:
    """A page sends it by HTTP too, and that may come first."""
    link = bench.peers.all["olga"].identity.token_id
    bench.peers.all["olga"].name = "Olga at the gate"
    bench.service.stop(Press(id="p", by=Actor("observer", "observer", "", link), where="http"))
    assert [message.by for message in bench.robot.sent] == ["Olga at the gate"]
    bench.peers.all["bob"].identity = bench.peers.all["olga"].identity
    bench.service.stop(Press(id="q", by=Actor("observer", "observer", "", link), where="http"))
    assert [message.by for message in bench.robot.sent] == ["Olga at the gate", "observer"], "one of two"


async def test_a_repeat_sends_nothing_and_has_the_outcome_of_its_first_also_when_that_is_not_delivered(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_service, "CONFIRM_SECONDS", 0.02)
    bench.press("olga", "p")
    bench.press("olga", "p", "http")
    assert len(bench.robot.sent) == 1
    first, again = await asyncio.gather(bench.service.outcome("p"), bench.service.outcome("p"))
    assert not first.delivered
    assert first == again
    bench.take("p", 3)
    bench.press("olga", "p", "control")
    assert (await bench.service.outcome("p")).number == 3
    assert len(bench.heard("olga", StopTaken)) == 2


async def test_a_press_whose_stop_was_reset_goes_to_the_robot_which_says_whether_it_is_a_new_one(bench: Bench) -> None:
    bench.press("olga", "p")
    bench.take("p", 3)
    bench.show(StopState(stopped=True, number=3, press="p"))
    bench.press("bob", "p")
    assert len(bench.robot.sent) == 1, "it holds: nothing is sent"
    bench.show(StopState(number=3, press="p"))
    for number, released in ((3, True), (4, False)):
        bench.robot.sent = []
        bench.press("bob", "p", "http")
        assert [cast(Stop, each).press for each in bench.robot.sent] == ["p"]
        bench.take("p", number)
        outcome = await bench.service.outcome("p")
        assert (outcome.number, outcome.released) == (number, released)
    assert [each.what for each in bench.records("stop") if "stop 3" in each.what][-1] == "http, stop 3, reset before"


async def test_with_no_robot_nobody_is_told_that_a_stop_was_delivered_however_many_press(bench: Bench) -> None:
    bench.lose()
    for who, press in (("ann", "a"), ("bob", "b"), ("bob", "b"), ("olga", "o")):
        bench.press(who, press)
    outcomes = await asyncio.gather(*map(bench.service.outcome, "abo"))
    assert [outcome.delivered for outcome in outcomes] == [False] * 3
    assert all("kept" in outcome.detail for outcome in outcomes)
    assert len([each for each in bench.peers.told if isinstance(each, Notice)]) == 1, "everyone is told once"
    assert {(each.who, each.what) for each in bench.records("stop")} >= {
        (who, "stop, not delivered yet") for who in ("ann", "bob", "olga")
    }
    assert bench.on_disk == 3


async def test_when_the_link_is_back_all_that_has_no_answer_goes_first_in_order(bench: Bench) -> None:
    bench.press("ann", "a")
    bench.lose()
    bench.press("bob", "b")
    bench.robot.up, bench.robot.sent = True, []
    bench.service.link_up()
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["a", "b"]
    bench.take("a", 1)
    bench.take("b", 2)
    assert bench.heard("ann", StopTaken) == [StopTaken(press="a", number=1)]
    assert [each.what for each in bench.records("stop")][-2:] == [
        "stop, sent again, stop 1",
        "stop, sent again, stop 2",
    ]
    bench.lose()
    bench.robot.up, bench.robot.sent = True, []
    bench.service.link_up()
    assert bench.robot.sent == []


async def test_stop_reset_stop_and_then_no_link_is_a_stop_that_is_sent_again(bench: Bench) -> None:
    bench.press("ann", "a")
    bench.take("a", 1)
    bench.stopped(1)
    resetting = bench.reset("ann", 1)
    await asyncio.sleep(0)
    bench.press("bob", "b")  # the old latch is still what the feedback shows
    bench.lose()
    assert await _raised(resetting) is LinkDown
    bench.robot.up, bench.robot.sent = True, []
    bench.service.link_up()
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["b"]


async def test_while_the_link_for_commands_is_down_a_stop_goes_by_the_one_for_media(bench: Bench) -> None:
    bench.press("ann", "a")
    bench.robot.media_up, bench.robot.sent = True, []
    bench.lose()
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["a"]
    bench.take("a", 1)
    assert (await bench.service.outcome("a")).delivered


async def test_what_a_link_that_lives_does_not_answer_is_sent_again_by_itself(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_service, "AGAIN_SECONDS", 0.0)
    monkeypatch.setattr(stop_service, "WATCH_SECONDS", 0.001)
    bench.press("ann", "a")
    async with asyncio.timeout(PATIENCE):
        while len(bench.robot.sent) < 3:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
    assert {cast(Stop, each).press for each in bench.robot.sent} == {"a"}


async def test_after_a_fault_of_ours_a_stop_without_an_answer_is_sent_again_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path)
    bench.press("ann", "a")
    sends = bench.robot.send_stop

    def fail(stop: Stop) -> bool:
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(stop_service, "AGAIN_SECONDS", 0.0)
    monkeypatch.setattr(bench.robot, "send_stop", fail)
    with pytest.raises(RuntimeError):
        await bench.service.run()
    monkeypatch.setattr(bench.robot, "send_stop", sends)
    before = len(bench.robot.sent)
    again = asyncio.create_task(bench.service.run())
    async with asyncio.timeout(PATIENCE):
        while len(bench.robot.sent) == before:  # noqa: ASYNC110
            await asyncio.sleep(0)
    again.cancel()


async def test_a_bridge_that_starts_anew_is_told_of_the_stop_that_held(bench: Bench) -> None:
    bench.press("ann", "a")
    bench.take("a", 1)
    bench.show(StopState(stopped=True, by="ann", reason="smoke", number=1, press="a"))
    bench.robot.sent = []
    bench.service.epoch_ends(bench.clock.stop)
    bench.service.link_up()
    assert bench.robot.sent == [Stop(by="ann", reason="smoke", press="a")]
    assert bench.service.unconfirmed
    bench.take("a", 1)
    bench.service.epoch_ends(StopState(stopped=False, number=1, press="a"))
    assert not bench.service.unconfirmed


async def test_a_bridge_that_starts_anew_is_told_of_a_stop_that_the_last_one_took_and_never_showed(
    bench: Bench,
) -> None:
    bench.press("ann", "a")
    bench.press("bob", "b")
    bench.take("b", 6, kept=False)
    bench.take("a", 5, kept=False)
    bench.service.epoch_ends(bench.clock.stop)
    assert [press.id for press in bench.keeper.presses.pending] == ["b"]
    bench.take("b", 1)
    bench.show(StopState(stopped=False, number=1))
    bench.service.epoch_ends(bench.clock.stop)
    assert bench.keeper.presses.pending == []


async def test_a_failed_write_is_said_to_whoever_pressed_and_to_everybody(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    (bench.directory / "kept-stops").write_text("in the way")
    bench.lose()
    bench.press("ann", "a")
    outcome = await bench.service.outcome("a")
    assert "not on the console's disk" in outcome.detail
    assert any("disk" in each.text for each in bench.peers.told if isinstance(each, Notice))
    assert [each.what for each in bench.records("stop")][-1] == "kept in memory only"
    assert len(list(bench.notices.for_newcomers())) == 1


async def test_a_flood_of_presses_of_one_link_is_few_stops_with_all_answered_and_anothers_goes_at_once(
    bench: Bench,
) -> None:
    for number in range(200):
        bench.press("olga", str(number))
    bench.press("ann", "a")
    ids = [cast(Stop, each).press for each in bench.robot.sent]
    assert ids == [*map(str, range(stop_service.PRESSES)), "a"]
    async with asyncio.timeout(PATIENCE):
        while len(bench.robot.sent) == len(ids):  # noqa: ASYNC110 - a look, which comes by itself
            await asyncio.sleep(0)
    for number, stop in enumerate(bench.robot.sent):
        bench.take(cast(Stop, stop).press, number + 1)
    assert not bench.service.unconfirmed
    answers = {answer.press: answer.number for answer in bench.heard("olga", StopTaken)}
    assert set(answers) == set(map(str, range(200)))
    assert answers["199"] == stop_service.PRESSES + 2
    assert bench.heard("ann", StopTaken)


async def test_a_press_that_was_answered_uses_up_none_of_what_its_link_may_press(bench: Bench) -> None:
    bench.press("olga", "a")
    bench.take("a", 1)
    for _ in range(200):
        bench.press("olga", "a")
    assert len(bench.heard("olga", StopTaken)) <= stop_service.PRESSES + 2
    bench.press("olga", "b")
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["a", "b"]


async def test_presses_that_are_held_go_with_all_others_when_the_link_is_back(bench: Bench) -> None:
    bench.lose()
    for number in range(stop_service.PRESSES + 5):
        bench.press("olga", str(number))
    bench.robot.up = True
    bench.service.link_up()
    assert len(bench.robot.sent) == stop_service.PRESSES + 1
    assert not (await bench.service.outcome(str(stop_service.PRESSES + 4))).delivered
    bench.take(str(stop_service.PRESSES), 9)
    assert (await bench.service.outcome(str(stop_service.PRESSES + 4))).number == 9


async def test_a_flood_of_presses_becomes_few_records(bench: Bench) -> None:
    for number in range(200):
        bench.press("olga", str(number))
        for stop in bench.robot.sent[-1:]:
            bench.take(cast(Stop, stop).press, number + 1)
    bench.press("ann", "a")
    bench.take("a", 201)
    records = bench.records("stop")
    assert len(records) <= STOPS + 4
    assert sum(record.count for record in records if record.who == "olga") >= 199
    assert [each.what for each in records if each.who == "ann"] == ["stop, stop 201"]


async def test_a_flood_of_presses_becomes_few_lines_of_the_log(bench: Bench) -> None:
    with capture_logs() as logs:
        for number in range(2 * stop_service.LINES):
            bench.press("olga", str(number))
            bench.take(str(number), number + 1)
        bench.press("sue", "f")
    written = [line["by"] for line in logs if line["event"] == "stop"]
    assert 1 <= written.count("olga") < 2 * stop_service.LINES
    assert written.count("sue") == 1


# silence


async def test_a_supervisor_silences_a_link_that_keeps_pressing_and_what_it_stopped_stays_stopped(bench: Bench) -> None:
    sue, olga = bench.peers.all["sue"], bench.peers.all["olga"]
    bench.press("olga", "p")
    assert bench.service.silence(cast(Peer, sue), olga.id, silent=True) is None
    assert bench.service.is_silenced(olga.identity.token_id)
    assert any("silenced" in each.text for each in bench.heard("olga", Notice))
    with pytest.raises(Silenced):
        bench.press("olga", "q")
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["p"]
    bench.take("p", 1)
    bench.press("ann", "a")
    assert bench.service.silence(cast(Peer, sue), olga.id, silent=False) is None
    assert not bench.service.is_silenced(olga.identity.token_id)
    bench.press("olga", "r")
    assert [each.what for each in bench.records("silence")] == ["silenced", "heard again"]
    assert ("olga", "silenced") in {(each.who, each.what) for each in bench.records("refusal")}


@pytest.mark.parametrize(("who", "whom"), [("ann", "olga"), ("olga", "ann"), ("sue", "sue"), ("sue", "nobody")])
async def test_only_supervisors_silence_and_nobody_silences_them(bench: Bench, who: str, whom: str) -> None:
    by = cast(Peer, bench.peers.all[who])
    assert bench.service.silence(by, f"{whom}-1", silent=True) == "not_allowed"
    bench.press("olga", "p")


async def test_a_silence_ends_by_itself_and_the_person_is_told(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    olga = bench.peers.all["olga"]
    bench.service.silence(cast(Peer, bench.peers.all["sue"]), olga.id, silent=True)
    assert olga.silenced
    bench.service.show_silence()
    assert [each.level for each in bench.heard("olga", Notice)] == ["warning"], "said once"
    later = time.monotonic() + SILENCE_SECONDS
    monkeypatch.setattr(time, "monotonic", lambda: later)
    bench.service.show_silence()
    assert [each.level for each in bench.heard("olga", Notice)] == ["warning", "info"]
    bench.press("olga", "p")


async def test_a_press_is_told_to_each_sender_by_the_id_that_it_gave(bench: Bench) -> None:
    press = new_press(bench.peers.all["olga"].actor, "stop", "smoke", "my stop")
    for given in ("my stop", "my stop", "x" * 65):
        bench.service.stop(press, given)
    (sent,) = bench.robot.sent
    assert isinstance(sent, Stop)
    assert sent.press == press.id != "my stop"
    bench.take(press.id, 4)
    assert [each.press for each in bench.heard("olga", StopTaken)] == ["my stop", press.id]
    bench.service.stop(press, "my stop")
    assert bench.heard("olga", StopTaken)[-1] == StopTaken(press="my stop", number=4)


# reset


async def test_a_reset_returns_when_the_robot_shows_that_it_is_released(bench: Bench) -> None:
    bench.stopped(4)
    resetting = bench.reset("ann", 4)
    await asyncio.sleep(0)
    bench.stopped(4)
    assert not resetting.done()
    assert bench.robot.sent == [Reset(by="ann", number=4)]
    bench.show(StopState(number=4))
    await resetting
    (record,) = bench.records("reset")
    assert (record.who, record.detail) == ("ann", "stop 4")
    await bench.reset("ann", 4)  # a repeat is no second reset
    assert len(bench.robot.sent) == 1


@pytest.mark.parametrize(
    ("reason", "error"), [("stale_reset", StaleReset), ("too_soon", ResetTooSoon), ("locked_out", LockedOut)]
)
async def test_what_the_robot_refuses_is_an_error_of_that_name_and_in_the_audit(
    bench: Bench, reason: RefusalReason, error: type[ConsoleError]
) -> None:
    bench.stopped(4)
    resetting = bench.reset("sue", 4)
    await asyncio.sleep(0)
    assert bench.service.refused(Refusal(event=0, reason=reason, current=1, stop=4, detail="why"))
    assert await _raised(resetting) is error
    assert [(each.who, each.what) for each in bench.records("reset")] == [("sue", f"http, refused {reason}")]


async def test_a_reset_never_passes_a_stop_that_has_no_answer_yet(bench: Bench) -> None:
    bench.stopped(4)
    bench.press("olga", "p")
    assert await _raised(bench.reset("ann", 4)) is StaleReset
    bench.take("p", 5)
    assert [type(each) for each in bench.robot.sent] == [Stop]


async def test_a_reset_of_the_stop_before_the_newest_is_stale_also_before_feedback_shows_the_newest(
    bench: Bench,
) -> None:
    bench.show(StopState(stopped=False, number=4))  # it was reset
    bench.press("olga", "p")
    bench.take("p", 5)
    assert await _raised(bench.reset("ann", 4)) is StaleReset
    assert [type(each) for each in bench.robot.sent] == [Stop]


async def test_a_stop_that_comes_while_a_reset_is_on_its_way_makes_that_stale(bench: Bench) -> None:
    bench.stopped(4)
    resetting = bench.reset("ann", 4)
    await asyncio.sleep(0)
    bench.press("olga", "p")
    bench.stopped(5)
    assert await _raised(resetting) is StaleReset


async def test_only_the_holder_of_the_seat_and_supervisors_reset(bench: Bench) -> None:
    bench.stopped(4)
    assert await _raised(bench.reset("olga", 4)) is NotAllowed
    assert await _raised(bench.reset("bob", 4)) is NoSeat
    assert await _raised(bench.reset("bob", 4, peer=True)) is NoSeat
    bench.holder = ""
    assert await _raised(bench.reset("ann", 4)) is NoSeat
    assert bench.robot.sent == []
    tried = {(each.who, each.what) for each in bench.records("reset")}
    assert tried == {
        ("olga", "http, refused not_allowed"),
        ("bob", "http, refused no_seat"),
        ("ann", "http, refused no_seat"),
    }


async def test_resets_that_come_too_often_are_refused_for_their_link_and_for_the_robot(bench: Bench) -> None:
    bench.stopped(4)
    for _ in range(stop_service.RESETS):
        assert await _raised(bench.reset("sue", 3)) is StaleReset
    assert await _raised(bench.reset("sue", 3)) is TooManyRequests
    for _ in range(stop_service.ROBOT_RESETS - stop_service.RESETS):
        assert await _raised(bench.reset("ann", 3)) is StaleReset
    assert await _raised(bench.reset("ann", 4)) is TooManyRequests
    bench.press("ann", "a")
    assert len(bench.robot.sent) == 1, "a stop is not limited"


async def test_without_a_link_and_without_an_answer_a_reset_says_so(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.stop.reset_attempts.PATIENCE", 0.01)
    monkeypatch.setattr(stop_service, "WATCH_SECONDS", 0.001)
    bench.stopped(4)
    assert await _raised(bench.reset("ann", 4)) is Unconfirmed
    bench.lose()
    assert await _raised(bench.reset("ann", 4)) is LinkDown


async def test_a_peer_is_told_of_a_refused_reset_by_its_number_on_the_channel_that_it_came_from(bench: Bench) -> None:
    bench.stopped(4)
    bench.service.reset_by_peer(cast(Peer, bench.peers.all["olga"]), 4)
    (refusal,) = bench.heard("olga", Refusal)
    assert (refusal.reason, refusal.stop, refusal.event) == ("not_allowed", 4, 0)
    bench.service.reset_by_peer(cast(Peer, bench.peers.all["ann"]), 4)
    bench.show(StopState(number=4))
    assert bench.heard("ann", Refusal) == []
