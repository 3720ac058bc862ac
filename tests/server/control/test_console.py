"""What cannot be brought about from outside: faults of our own, a robot that contradicts itself."""

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path
from typing import cast

import pytest

from lockstep.protocol.console import SeatRequest
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import (
    Command,
    Feedback,
    LinkMessage,
    Media,
    Refusal,
    Reset,
    Rest,
    Stop,
    StopState,
    StopTaken,
)
from lockstep.server.audit.audit_tail import AuditTail
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.auth.silenced_links import SilencedLinks
from lockstep.server.auth.tokens import Identity
from lockstep.server.control.console import Console
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_table import SeatOutcome
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.control.stop.stop_silence import StopSilence
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.peers.websocket_transport import peer_beside_relay
from lockstep.server.robot.robot_connection import RobotConnection, RobotHost
from lockstep.server.session_events import SessionEvent, SessionEvents
from lockstep.server.settings import Settings
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.fair_queue import FairQueue
from tests.makers import feedback
from tests.server.rig import PATIENCE

ROBOT = RobotDescription(name="r", label="R", axes=())
AXIS = Axis(name="x", label="X", unit="m/s", minimum=-1.0, maximum=1.0, slew=1.0, brake=1.0)
ONE_AXIS = RobotDescription(name="r", label="R", axes=(AXIS,))


class FakePlane:
    def __init__(self) -> None:
        self.configured: list[RobotDescription] = []
        self.fed = 0

    def configure(self, description: RobotDescription) -> None:
        self.configured.append(description)

    def feed(self, media: Media, now: float) -> None:
        self.fed += 1


def _console(settings: Settings, metrics: Metrics, stops: StopKeeper, events: SessionEvents | None = None) -> Console:
    """A console to whose events nobody subscribes, unless `events` has subscribers."""
    clock, events = EventClock(), events or SessionEvents(metrics.faults)
    seat, audit = ControlSeat(SeatTimes(settings.seat_timeout)), AuditTrail(clock, AuditTail())
    peers = PeerRegistry(settings, metrics)
    silence = StopSilence(SilencedLinks(), peers, events)
    return Console(
        settings, events, metrics.faults, FakePlane(), peers, seat, audit, clock, stops=stops, silence=silence
    )


async def test_a_background_task_that_fails_is_counted_and_runs_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("lockstep.server.telemetry.background.RESTART_AFTER", 0.0)
    metrics = Metrics()
    wanted = Settings(robot="tcp://127.0.0.1:1", seat_timeout=0.01)
    stops = StopKeeper(tmp_path, wanted.robot)
    console = _console(wanted, metrics, stops)
    failed: list[float] = []
    again = asyncio.Event()

    def expire(now: float) -> list[SeatOutcome]:
        if len(failed) < 2:
            failed.append(now)
            raise RuntimeError("a fault of ours")
        again.set()
        return []

    monkeypatch.setattr(console.seat.rules, "expire", expire)
    running = asyncio.create_task(console.run())
    async with asyncio.timeout(PATIENCE):
        await again.wait()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert metrics.registry.get_sample_value("lockstep_internal_errors_total", {"where": "seat"}) == 2


def _fails(event: SessionEvent) -> None:
    raise RuntimeError("a fault of a subscriber")


@pytest.mark.parametrize("subscribers_fail", [False, True])
async def test_stop_seat_and_commands_need_no_subscriber_and_survive_subscribers_that_fail(
    subscribers_fail: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    settings, metrics = Settings(robot="tcp://127.0.0.1:1"), Metrics(process=False)
    events = SessionEvents(metrics.faults)
    for kind in SessionEvent.__subclasses__() if subscribers_fail else ():
        events.subscribe(kind, _fails)
    console = _console(settings, metrics, StopKeeper(tmp_path, settings.robot), events)
    sent: list[LinkMessage] = []

    def send(message: LinkMessage) -> bool:
        sent.append(message)
        return True

    monkeypatch.setattr(console.robot, "send", send)
    monkeypatch.setattr(console.robot, "send_stop", send)
    console.robot.link_opened("operator", "epoch", ONE_AXIS)

    def peer(name: str) -> Peer:
        identity = Identity("operator", name, name, 1e12)
        made, _ = peer_beside_relay("", identity, console, settings, FairQueue())
        console.peers.admit(made)
        return made

    running = AsyncExitStack()
    await running.enter_async_context(console.peers.running())
    ann, bob, issues = peer("ann"), peer("bob"), list[int]()

    def command(by: Peer, event: int, value: float) -> list[LinkMessage]:
        sent.clear()
        console.message_received(by, "control", Command(event=event, issue=issues[-1], nonce=7, values=[value]))
        return [*sent]

    def feedback(event: int, stop: StopState | None = None) -> None:
        issues.append(len(issues) + 1)
        shown = Feedback(event=event, issue=issues[-1], nonce=7, time=0.0, axes=[0.0], stop=stop or StopState())
        console.robot.link_received("operator", shown)

    feedback(1)
    assert command(ann, 2, 0.0) == [], "nobody holds the seat"
    console.message_received(ann, "session", SeatRequest())
    assert command(ann, 2, 0.5) == [], "a new holder sends a neutral command first"
    assert [type(each) for each in command(ann, 2, 0.0)] == [Command]
    feedback(2)
    assert command(bob, 3, 0.5) == []
    assert [type(each) for each in command(ann, 3, 0.5)] == [Command]
    feedback(3)
    console.message_received(bob, "stop", Stop(press="1" * 32, reason="smoke"))
    assert [type(each) for each in sent[1:]] == [Stop]
    assert command(ann, 4, 0.5) == [], "the stop is on its way"
    console.robot.link_received("operator", StopTaken(press="1" * 32, number=1))
    feedback(3, StopState(stopped=True, number=1))
    assert command(ann, 4, 0.5) == []
    console.message_received(ann, "stop", Reset(number=1))
    assert [type(each) for each in sent] == [Reset]
    feedback(3, StopState(number=1))
    sent.clear()
    ann.end("gone")
    assert (console.seat.state.holder, [type(each) for each in sent]) == ("", [Rest])
    await running.aclose()
    assert (sum(_faults(metrics)) > 0) == subscribers_fail


def _faults(metrics: Metrics) -> list[float]:
    families = metrics.internal_errors.collect()
    return [each.value for family in families for each in family.samples if each.name.endswith("_total")]


class FakeHost:
    def __init__(self) -> None:
        self.calls: list[str] = []

    def epoch_began(self, epoch: str, description: RobotDescription) -> None:
        self.calls.append(f"epoch {epoch}")

    def robot_link_up(self) -> None:
        self.calls.append("up")

    def robot_link_down(self, detail: str) -> None:
        self.calls.append(f"down {detail}")

    def feedback_received(self, feedback: Feedback) -> None:
        self.calls.append(f"feedback {feedback.event}")

    def link_message_received(self, message: LinkMessage) -> None:
        self.calls.append(
            f"taken {message.press}" if isinstance(message, StopTaken) else type(message).__name__.lower()
        )

    def feed(self, media: Media, now: float) -> None:
        self.calls.append("media")


def _connection() -> tuple[RobotConnection, FakeHost]:
    host = FakeHost()
    return RobotConnection(Settings(), cast(RobotHost, host), host, Metrics(process=False).faults), host


def test_whichever_link_meets_the_new_bridge_first_begins_the_epoch() -> None:
    connection, host = _connection()
    connection.link_opened("media", "a", ROBOT)
    assert not connection.up
    connection.link_opened("operator", "a", ROBOT)
    assert host.calls == ["epoch a", "up"]
    assert connection.up


def test_what_the_old_bridge_said_last_is_not_taken_for_the_new_ones() -> None:
    connection, host = _connection()
    connection.link_opened("operator", "a", ROBOT)
    connection.link_opened("media", "b", ROBOT)
    connection.link_received("operator", feedback(900))
    connection.link_closed("operator", "lost")
    connection.link_opened("operator", "b", ROBOT)
    connection.link_received("operator", feedback(1))
    assert host.calls == ["epoch a", "up", "epoch b", "down lost", "up", "feedback 1"]


def test_only_the_operator_link_decides_whether_the_robot_is_up_and_the_same_trouble_is_told_once() -> None:
    connection, host = _connection()
    connection.link_opened("operator", "a", ROBOT)
    connection.link_closed("media", "lost")
    assert connection.up
    for _ in range(3):
        connection.link_closed("operator", "refused")
    assert host.calls == ["epoch a", "up", "down refused"]


def test_each_kind_of_message_goes_its_way() -> None:
    connection, host = _connection()
    connection.link_opened("operator", "a", ROBOT)
    messages: list[LinkMessage] = [
        feedback(1),
        Refusal(event=1, reason="late", current=1),
        Media(stream="x", codec="mjpeg", stamp=1, time=0.0, payload=b""),
    ]
    for message in messages:
        connection.link_received("operator", message)
    assert host.calls[2:] == ["feedback 1", "refusal", "media"]


def test_the_answer_to_a_stop_counts_on_both_links() -> None:
    connection, host = _connection()
    connection.link_opened("operator", "a", ROBOT)
    connection.link_opened("media", "a", ROBOT)
    connection.link_received("media", StopTaken(press="p", number=1))
    connection.link_received("operator", StopTaken(press="q", number=2))
    assert host.calls[2:] == ["taken p", "taken q"]


@pytest.mark.parametrize("living", [("operator", "media"), ("media",), ("operator",), ()])
def test_a_stop_goes_by_every_link_that_lives_since_one_may_be_stalled(
    living: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []

    class FakeKeeper:
        def __init__(self, host: str, port: int, role: str, *_: object) -> None:
            self.role = role

        def send(self, message: LinkMessage) -> bool:
            sent.extend([self.role] if self.role in living else [])
            return self.role in living

    monkeypatch.setattr("lockstep.server.robot.robot_connection.ReconnectingRobotLink", FakeKeeper)
    connection, _ = _connection()
    assert connection.send_stop(Stop()) == bool(living)
    assert sent == list(living)


def test_without_a_link_nothing_is_sent() -> None:
    connection, _ = _connection()
    assert not connection.send_stop(Stop())
    assert not connection.send(Rest(event=1))
