"""Whatever serving one peer raises ends that peer, by name, counted and logged once; nobody else notices."""

import asyncio
import traceback
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any, NoReturn, cast

import pytest
from aiortc import InvalidStateError, RTCSessionDescription
from structlog.testing import capture_logs

from lockstep.protocol.console import Role
from lockstep.protocol.messages import Ping, Pong
from lockstep.server.media.subscriptions import Subscriptions
from lockstep.server.peers.peer import Peer
from lockstep.server.telemetry.faults import Faults
from tests.server.rig import Rig, TestPeer, eventually, running_rig

ROOT = Path(__file__).resolve().parents[3]
OBSERVERS = 8
FAULT = "planted"

Plant = Callable[[Rig, Peer, pytest.MonkeyPatch], None]


@pytest.fixture(autouse=True)
def faults_of_the_console_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The viewers are aiortc's and share the loop: what their tasks raise after they were closed is not counted."""
    uncaught = Faults.uncaught

    def of_the_console(faults: Faults, loop: object, context: dict[str, Any]) -> None:
        error = context.get("exception")
        frames = traceback.extract_tb(error.__traceback__) if isinstance(error, InvalidStateError) else []
        if not frames or any(f"{ROOT}/{part}/" in frame.filename for frame in frames for part in ("server", "rtc")):
            uncaught(faults, loop, context)

    monkeypatch.setattr(Faults, "uncaught", of_the_console)


class _Viewer(TestPeer):
    """Receives pictures and sound, and decodes nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.packets = {"video": 0, "audio": 0}
        for kind in self.packets:
            self._count(kind, self.pc.addTransceiver(kind, "recvonly").receiver)

    def _count(self, kind: str, receiver: Any) -> None:
        async def count(packet: object, arrival_time_ms: int) -> None:
            self.packets[kind] += 1

        receiver._handle_rtp_packet = count

    async def ask_for_keyframe(self, ssrc: int) -> None:
        receiver: Any = self.pc.getTransceivers()[0].receiver
        await receiver._send_rtcp_pli(ssrc)

    async def goes_on(self) -> None:
        """Returns when more of everything has come: pictures, and an answer on the channel."""
        before, number = self.packets["video"], len(self.heard)
        await eventually(lambda: self.packets["video"] > before + 2)
        self.send("control", Ping(id=number))
        await self.until(lambda each: each == Pong(id=number))


@asynccontextmanager
async def _watching(rig: Rig, role: Role) -> AsyncIterator[_Viewer]:
    viewer = _Viewer()
    try:
        await viewer.join(rig, rig.token(role), ("control", "session", "stop"))
        yield viewer
    finally:
        await viewer.close()


def _raise(*_: object, **__: object) -> NoReturn:
    raise ValueError(FAULT)


async def _raise_later(*_: object, **__: object) -> NoReturn:
    raise ValueError(FAULT)


def _delivery(peer: Peer) -> Any:
    return cast(Any, peer).media.deliveries[0]


def _connection(peer: Peer) -> Any:
    return cast(Any, peer).transport._connection


def _stream(peer: Peer) -> Any:
    """The first that it gets, with all stages on its way out."""
    return _connection(peer).peer.media.streams.outgoing[_delivery(peer).info.mid]


def _answer(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(_delivery(peer).stream.encodings, "join", _raise)


def _queueing(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(_delivery(peer).target, "put", _raise)


def _packing(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(_connection(peer).peer.media, "frame_to_send", _raise)


def _stage(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(_stream(peer).reports, "rtp", _raise)


def _reporting(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(_stream(peer).reports, "_report", _raise)


def _receiving(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(_connection(peer).peer, "receive_datagram", _raise)


def _rtcp(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    delivery = _delivery(peer)
    request, target = delivery.stream.encodings.request_keyframe, delivery.target

    def fail_for_it(who: Any, cause: str) -> None:
        if who is target:  # the others ask too, when a busy machine drops their frames
            _raise()
        request(who, cause)

    patch.setattr(delivery.stream.encodings, "request_keyframe", fail_for_it)


def _message_in(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    console = rig.dependencies.console
    received = console.message_received

    def fail_for_it(who: Any, channel: Any, message: Any) -> None:
        if who is peer:
            _raise()
        received(who, channel, message)

    patch.setattr(console, "message_received", fail_for_it)


def _message_out(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(cast(Any, peer).transport._writers["control"], "send_newest", _raise)


def _flushing(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(cast(Any, peer).transport._writers["control"], "flush", _raise)


def _showing(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    class LossFails(Subscriptions):
        @property
        def loss(self) -> float | None:
            _raise()

    patch.setattr(peer.media, "__class__", LossFails)


def _driving(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(peer.media, "drives", _raise)
    peer.drives(True)


def _wanting_traces(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(peer.media.traces, "want", _raise)
    peer.want_traces(True)


def _taking_traces(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(peer.media.traces, "take", _raise)
    assert peer.take_traces(1) == []


def _closing_media(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(cast(Any, peer).media, "close", _raise_later)
    peer.end("the test ends it")


def _closing_connection(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(_connection(peer).peer, "close", _raise)
    peer.end("the test ends it")


def _forgetting(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    delivery = _delivery(peer)
    leave, target = delivery.stream.encodings.leave, delivery.target

    def fail_for_it(who: Any) -> None:
        leave(who)
        if who is target:
            _raise()

    patch.setattr(delivery.stream.encodings, "leave", fail_for_it)
    peer.end("the test ends it")


def _seeing_off(rig: Rig, peer: Peer, patch: pytest.MonkeyPatch) -> None:
    people = rig.dependencies.console.people
    left = people.left

    def fail_for_it(who: Any) -> None:
        left(who)
        if who is peer:
            _raise()

    patch.setattr(people, "left", fail_for_it)
    peer.end("the test ends it")


CASES: list[tuple[str, Role, Plant]] = [
    ("media", "observer", _queueing),
    ("media", "operator", _queueing),
    ("media", "observer", _packing),
    ("media", "operator", _stage),
    ("media", "observer", _driving),
    ("media", "observer", _wanting_traces),
    ("media", "operator", _taking_traces),
    ("connection", "observer", _reporting),
    ("connection", "operator", _receiving),
    ("rtcp", "operator", _rtcp),
    ("message in", "operator", _message_in),
    ("message out", "observer", _message_out),
    ("message out", "operator", _message_out),
    ("message out", "operator", _flushing),
    ("participant", "observer", _showing),
    ("close", "observer", _closing_media),
    ("connection", "observer", _closing_connection),
    ("forget", "observer", _forgetting),
    ("end", "observer", _seeing_off),
]


@asynccontextmanager
async def _nine_others() -> AsyncIterator[tuple[Rig, list[_Viewer]]]:
    async with running_rig(max_offer_rate=100.0, max_offer_burst=100) as rig, AsyncExitStack() as stack:
        roles: list[Role] = ["operator", *["observer"] * OBSERVERS]  # type: ignore[list-item]
        yield rig, [await stack.enter_async_context(_watching(rig, role)) for role in roles]


def _faults(rig: Rig) -> dict[str, float]:
    return {
        sample.labels["where"]: sample.value
        for family in rig.dependencies.metrics.internal_errors.collect()
        for sample in family.samples
        if sample.name.endswith("_total")
    }


def _of_aiortc() -> set[asyncio.Task[Any]]:
    """Its tasks: a connection that is closed while it connects leaves some."""
    return {task for task in asyncio.all_tasks() if "aiortc" in repr(task)}


async def _gone(rig: Rig, peer: Peer) -> None:
    await eventually(lambda: peer not in rig.webrtc_peers)


async def _everything_is_given_back(rig: Rig, others: list[_Viewer]) -> None:
    await eventually(lambda: len(rig.dependencies.console.peers) == len(others))
    assert rig.dependencies.console.peers.places.taken == len(others)
    assert rig.dependencies.context.endpoint.connections == len(others)
    for other in others:
        await other.goes_on()


async def test_a_fault_in_any_stage_of_one_peer_of_ten_ends_that_one_alone() -> None:
    async with _nine_others() as (rig, others):
        for other in others:
            await other.goes_on()
        for stage, role, plant in CASES:
            before = _faults(rig)
            with pytest.MonkeyPatch.context() as patch, capture_logs() as logs:
                async with _watching(rig, role) as victim:
                    await victim.goes_on()
                    peer = rig.webrtc_peers[-1]
                    plant(rig, peer, patch)
                    if plant is _message_in:
                        victim.send("control", Ping(id=1))
                    elif plant is _rtcp:
                        await victim.ask_for_keyframe(_stream(peer).parameters.ssrc)
                    await _gone(rig, peer)
                    assert peer.ended in ("internal error", "the test ends it"), plant
                await _everything_is_given_back(rig, others)
            after = _faults(rig)
            others_told = [each for each in logs if each.get("where") != f"peer {stage}" and "where" in each]
            assert after == before | {f"peer {stage}": before.get(f"peer {stage}", 0.0) + 1}, (plant, others_told)
            told = [each for each in logs if each.get("where") == f"peer {stage}"]
            assert len(told) <= 1, plant
            assert all(each["peer"] == peer.id for each in told)


async def test_a_fault_while_an_offer_is_answered_refuses_it_by_name_and_keeps_nothing() -> None:
    async with running_rig() as rig, _watching(rig, "operator") as other:
        await other.goes_on()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(rig.dependencies.media.subscribers, "attach", _raise)
            refused = _Viewer()
            try:
                answer = await rig.http.post(
                    "/whep",
                    content=await refused.offer(),
                    headers={**rig.token("operator"), "Content-Type": "application/sdp"},
                )
            finally:
                await refused.close()
        assert (answer.status_code, answer.json()["error"]) == (500, "internal_error")
        assert FAULT not in answer.text
        assert _faults(rig) == {"peer offer": 1}
        await _everything_is_given_back(rig, [other])


async def test_a_fault_when_the_transport_connects_ends_that_peer_alone() -> None:
    async with running_rig() as rig, _watching(rig, "operator") as other:
        others, victim = _of_aiortc(), _Viewer()
        try:
            with pytest.MonkeyPatch.context() as patch:
                answer = await rig.http.post(
                    "/whep",
                    content=await victim.offer(),
                    headers={**rig.token("operator"), "Content-Type": "application/sdp"},
                )
                assert answer.status_code == 201
                _answer(rig, rig.webrtc_peers[-1], patch)
                await victim.pc.setRemoteDescription(RTCSessionDescription(answer.text, "answer"))
                await eventually(lambda: len(rig.webrtc_peers) == 1)
        finally:
            await victim.close()
            for task in _of_aiortc() - others:
                task.cancel()
        assert _faults(rig) == {"peer answer": 1}
        assert rig.count("lockstep_peers_ended_total", why="internal error") == 1
        await _everything_is_given_back(rig, [other])


@pytest.mark.parametrize(("number", "answered"), [(4096, True), (4351, True), (255, True), (16, True), (256, False)])
async def test_no_id_of_a_header_extension_takes_media_from_anybody(number: int, answered: bool) -> None:
    async with running_rig() as rig, _watching(rig, "observer") as other:
        peer = _Viewer()
        try:
            uri = "urn:x-lockstep:rtp-hdrext:event-reference"
            text = (await peer.offer()).replace("a=rtcp-mux\r\n", f"a=rtcp-mux\r\na=extmap:{number} {uri}\r\n")
            answer = await rig.http.post(
                "/whep", content=text, headers={**rig.token("operator"), "Content-Type": "application/sdp"}
            )
            assert answer.status_code == 201
            assert (uri in answer.text) == answered
            ids = [int(line[9:].split()[0]) for line in answer.text.splitlines() if line.startswith("a=extmap:")]
            assert all(1 <= each <= 255 for each in ids)
            await peer.pc.setRemoteDescription(RTCSessionDescription(answer.text, "answer"))
            await eventually(lambda: peer.packets["video"] > 3)
            await other.goes_on()
            async with _watching(rig, "operator") as newcomer:
                await newcomer.goes_on()
        finally:
            await peer.close()
        assert not _faults(rig)
