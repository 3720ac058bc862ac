"""Who is told of spans, how much, and what an operator's client may report."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from lockstep.protocol.console import decode_server_message
from lockstep.protocol.traces.trace import CommandSpans, PictureSpans, known_spans
from lockstep.protocol.traces.trace_messages import MAX_TRACED_COMMANDS, EventTrace, PictureTrace, TraceReport, Traces
from lockstep.server.control import trace_service
from lockstep.server.control.trace_service import TraceService, command_spans

SPANS = CommandSpans(forward_ms=1.0)
TRACE = PictureTrace(stream="front", stamp=1, rtp_time=90, spans=PictureSpans(encode_ms=2.0))


class FakePeer:
    def __init__(self, role: str = "operator") -> None:
        self.ended = ""
        self.role = role
        self.wanted: list[bool] = []
        self.pictures: list[PictureTrace] = []
        self.told: asyncio.Queue[Traces] = asyncio.Queue()

    def want_traces(self, wanted: bool) -> None:
        self.wanted.append(wanted)

    def take_traces(self, most: int) -> list[PictureTrace]:
        taken, self.pictures = self.pictures[:most], []
        return taken

    def send_spare(self, text: str) -> None:
        message = decode_server_message(text)
        assert isinstance(message, Traces)
        self.told.put_nowait(message)

    async def next(self) -> Traces:
        async with asyncio.timeout(10):
            return await self.told.get()


@asynccontextmanager
async def _running(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[TraceService]:
    monkeypatch.setattr(trace_service, "TURN_SECONDS", 0.001)
    service = TraceService()
    async with asyncio.TaskGroup() as tasks:
        task = tasks.create_task(service.run())
        yield service
        task.cancel()


async def test_a_peer_is_told_what_came_since_it_asked_and_each_command_once(monkeypatch: pytest.MonkeyPatch) -> None:
    async with _running(monkeypatch) as service:
        peer = FakePeer()
        service.executed(1, SPANS)
        service.request(peer, True)
        service.executed(2, SPANS)
        assert [each.event for each in (await peer.next()).commands] == [2]
        service.executed(3, SPANS)
        peer.pictures = [TRACE]
        told = await peer.next()
        assert ([each.event for each in told.commands], told.pictures) == ([3], [TRACE])


async def test_a_peer_that_does_not_ask_or_asks_no_more_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    async with _running(monkeypatch) as service:
        silent, former, witness = FakePeer(), FakePeer(), FakePeer()
        service.request(former, True)
        service.request(former, True)
        service.request(former, False)
        service.request(silent, False)
        service.request(witness, True)
        service.executed(1, SPANS)
        await witness.next()
        assert former.wanted == [True, False]
        assert silent.wanted == []
        assert silent.told.empty()
        assert former.told.empty()


async def test_an_observer_is_told_too_and_a_peer_that_has_ended_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    async with _running(monkeypatch) as service:
        observer, gone = FakePeer("observer"), FakePeer()
        for peer in (observer, gone):
            service.request(peer, True)
        gone.ended = "channel closed"
        service.forget(gone)
        service.forget(gone)
        service.executed(1, SPANS)
        assert (await observer.next()).commands
        assert gone.told.empty()


async def test_what_does_not_fit_in_a_message_is_left_out_and_the_newest_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    async with _running(monkeypatch) as service:
        peer = FakePeer()
        service.request(peer, True)
        for event in range(1, 1001):
            service.executed(event, SPANS)
        told = await peer.next()
        assert [each.event for each in told.commands] == list(range(1001 - MAX_TRACED_COMMANDS, 1001))


async def test_a_report_is_completed_with_what_the_console_knows_itself() -> None:
    service = TraceService()
    service.executed(7, CommandSpans(forward_ms=1.0, apply_ms=2.0))
    reported = TraceReport(events=[EventTrace(event=7, command=CommandSpans(forward_ms=99.0, input_ms=5.0))])
    (event,) = service.reported(reported, (), now=0.0)
    assert known_spans(event.command) == {"input_ms": 5.0, "forward_ms": 1.0, "apply_ms": 2.0}
    service.epoch_ends()
    (other,) = service.reported(reported, (), now=1.0)
    assert known_spans(other.command) == {"input_ms": 5.0, "forward_ms": 99.0}


async def test_a_client_that_reports_without_end_fills_no_recording() -> None:
    service = TraceService()
    report = TraceReport(events=[EventTrace(event=1)] * 32)
    kept = sum(len(service.reported(report, (), now=0.0)) for _ in range(1000))
    assert kept == 200
    assert len(service.reported(report, (), now=0.1)) == 10


def test_the_link_is_what_the_robots_spans_leave_of_the_round_trip() -> None:
    robot = CommandSpans(tick_wait_ms=2.0, apply_ms=1.0, measure_ms=1.0, between_ms=77.0)
    spans = command_spans(robot, forward=0.001, link=0.010, back=0.002)
    assert known_spans(spans) == {
        "forward_ms": 1.0,
        "tick_wait_ms": 2.0,
        "apply_ms": 1.0,
        "measure_ms": 1.0,
        "back_ms": 2.0,
        "link_ms": 6.0,
    }


def test_without_spans_of_the_robot_the_whole_round_trip_is_the_links() -> None:
    assert command_spans(CommandSpans(), forward=0.0, link=0.010, back=0.0).link_ms == 10.0


def test_a_reported_picture_of_a_camera_that_the_client_does_not_get_is_left_out_and_the_command_stays() -> None:
    service, picture = TraceService(), PictureSpans(draw_ms=1.0)
    reported = TraceReport(
        events=[EventTrace(event=7, command=SPANS, stream=name, picture=picture) for name in ("front", "made up", "")]
    )
    found = service.reported(reported, {"front"}, now=0.0)
    assert [(each.stream, known_spans(each.picture)) for each in found] == [
        ("front", {"draw_ms": 1.0}),
        ("", {}),
        ("", {}),
    ]
    assert [each.command for each in found] == [SPANS] * 3
