"""What cannot be brought about from outside: faults of our own, a robot that contradicts itself."""

import asyncio
from pathlib import Path
from typing import cast

import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback, LinkMessage, Media, Refusal, Rest, Stop, StopTaken
from lockstep.server.audit.audit_tail import AuditTail
from lockstep.server.control.console import Console
from lockstep.server.control.seat import SeatOutcome
from lockstep.server.robot.robot_connection import RobotConnection, RobotHost
from lockstep.server.settings import Settings
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.telemetry.metrics import Metrics
from tests.makers import feedback
from tests.server.rig import PATIENCE

ROBOT = RobotDescription(name="r", label="R", axes=())


class FakePlane:
    def __init__(self) -> None:
        self.configured: list[RobotDescription] = []
        self.fed = 0

    def configure(self, description: RobotDescription) -> None:
        self.configured.append(description)

    def feed(self, media: Media, now: float) -> None:
        self.fed += 1


async def test_a_background_task_that_fails_is_counted_and_runs_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("lockstep.server.control.console.RESTART_AFTER", 0.0)
    metrics = Metrics()
    wanted = Settings(robot="tcp://127.0.0.1:1", seat_timeout=0.01)
    stops = StopKeeper(tmp_path, wanted.robot)
    console = Console(wanted, metrics, FakePlane(), None, AuditTail(), stops=stops)
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


class FakeHost:
    def __init__(self) -> None:
        self.calls: list[str] = []

    def epoch_began(self, epoch: str, description: RobotDescription) -> None:
        self.calls.append(f"epoch {epoch}")

    def link_up(self) -> None:
        self.calls.append("up")

    def link_down(self, detail: str) -> None:
        self.calls.append(f"down {detail}")

    def feedback_received(self, feedback: Feedback) -> None:
        self.calls.append(f"feedback {feedback.event}")

    def refusal_received(self, refusal: Refusal) -> None:
        self.calls.append("refusal")

    def stop_taken(self, taken: StopTaken) -> None:
        self.calls.append(f"taken {taken.press}")

    def media_received(self, media: Media) -> None:
        self.calls.append("media")


def _connection() -> tuple[RobotConnection, FakeHost]:
    host = FakeHost()
    return RobotConnection(Settings(), cast(RobotHost, host)), host


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

    monkeypatch.setattr("lockstep.server.robot.robot_connection.ReconnectingLink", FakeKeeper)
    connection, _ = _connection()
    assert connection.send_stop(Stop()) == bool(living)
    assert sent == list(living)


def test_without_a_link_nothing_is_sent() -> None:
    connection, _ = _connection()
    assert not connection.send_stop(Stop())
    assert not connection.send(Rest(event=1))
