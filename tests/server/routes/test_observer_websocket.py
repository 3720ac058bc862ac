"""Tickets and lines of observers behind a relay, over real HTTP and real WebSockets."""

import asyncio
import socket
from contextlib import suppress
from typing import Any

import pytest
import websockets
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode

from lockstep.protocol.console import (
    Note,
    Participants,
    Rename,
    Report,
    RobotState,
    SeatRequest,
    SharedNote,
    StopStateNotice,
    Welcome,
)
from lockstep.protocol.messages import Command, Feedback, Ping, Pong, Refusal, Reset, Stop
from lockstep.server.http.transport.uvicorn_websocket_limits import CONTROL_BURST, MAX_FRAGMENTS
from lockstep.server.peers.channels import MAX_MESSAGE
from tests.server.rig import PATIENCE, Rig, eventually, running_rig
from tests.server.watch_lines import NOWHERE, TestLine, address, joined, open_line, ticket

RELAYED: dict[str, Any] = {"relay": NOWHERE, "observers_direct": 0}


async def _refused(url: str, **headers: str) -> int:
    with pytest.raises(websockets.InvalidStatus) as refused:
        async with connect(url, proxy=None, additional_headers=headers):
            pass
    return refused.value.response.status_code


async def test_a_line_tells_all_that_data_channels_tell_and_pictures_are_somebody_elses() -> None:
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        welcome = await line.until(lambda each: isinstance(each, Welcome))
        for kind in (Feedback, StopStateNotice, RobotState, Participants):
            await line.until(lambda each, kind=kind: isinstance(each, kind))  # type: ignore[misc]
        assert isinstance(welcome, Welcome)
        assert (welcome.role, welcome.streams, welcome.voice) == ("observer", [], "")
        session = await rig.session()
        assert [(each["peer"], each["carrier"]) for each in session["participants"]] == [(welcome.peer, "trailer")]
        assert next(iter(rig.dependencies.console.peers)) not in rig.dependencies.console.peers.observers()


async def test_pings_reports_notes_names_and_stop_go_over_a_line_as_over_data_channels() -> None:
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        await line.send(Ping(id=7))
        await line.until(lambda each: each == Pong(id=7))
        await line.send(Report(event=1, armed=False, streams=[], round_trip_ms=12.0, ping=8))
        await line.until(lambda each: each == Pong(id=8))
        assert (await rig.session())["participants"][0]["round_trip_ms"] == 12.0
        await line.send(Rename(name="Ann"))
        await line.send(Note(text="seen"))
        note = await line.until(lambda each: isinstance(each, SharedNote))
        assert isinstance(note, SharedNote)
        assert (note.name, note.text) == ("Ann", "seen")
        await line.send(Stop(reason="an observer says so"))
        await line.until(lambda each: isinstance(each, StopStateNotice) and each.stop.stopped)
        assert rig.count("lockstep_stops_total", where="stop") == 1


async def test_a_line_drives_nothing_resets_nothing_and_gets_no_seat() -> None:
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        feedback = await line.until(lambda each: isinstance(each, Feedback))
        assert isinstance(feedback, Feedback)
        await line.send(
            Command(
                event=feedback.event + 1, issue=feedback.issue, nonce=feedback.nonce, values=[0.1] * len(feedback.axes)
            )
        )
        await line.until(lambda each: isinstance(each, Refusal) and each.reason == "no_seat")
        await line.send(SeatRequest())
        await line.until(lambda each: isinstance(each, Refusal) and each.reason == "not_allowed")
        await line.send(Reset())
        await line.until(lambda each: isinstance(each, Refusal) and each.detail == "observers may not reset a stop")
        assert rig.count("lockstep_resets_total") == 0


async def test_only_observers_get_a_ticket_and_only_for_a_relay_that_there_is() -> None:
    async with running_rig(**RELAYED) as rig:
        for role, query, status, name in [
            ("operator", "?relay=0", 403, "not_allowed"),
            ("supervisor", "?relay=0", 403, "not_allowed"),
            ("observer", "?relay=9", 404, "not_found"),
            ("observer", "?relay=x", 422, "bad_parameter"),
            ("observer", "", 422, "bad_parameter"),
        ]:
            answer = await rig.http.post(f"/api/watch{query}", headers=rig.token(role))  # type: ignore[arg-type]
            assert (answer.status_code, answer.json()["error"]) == (status, name)
        assert (await rig.http.post("/api/watch?relay=0")).status_code == 401
        foreign = {**rig.token("observer"), "Origin": "https://evil.example"}
        assert (await rig.http.post("/api/watch?relay=0", headers=foreign)).status_code == 403
        assert len(rig.dependencies.console.peers) == 0


async def test_a_ticket_opens_one_line_and_a_made_up_or_returned_one_none() -> None:
    async with running_rig(**RELAYED) as rig:
        used = await ticket(rig)
        async with joined(address(rig, used)) as socket:
            await TestLine(socket, {}).until(lambda each: isinstance(each, Welcome))
            assert await _refused(address(rig, used)) == 403
            assert len(rig.dependencies.console.peers) == 1
        for made_up in ("x", "a" * 22, "%00"):
            assert await _refused(address(rig, made_up)) == 403
        headers = rig.token("observer")
        returned = await ticket(rig, headers)
        path = f"/watch/{returned}"
        assert (await rig.http.delete(path, headers=rig.token("observer"))).status_code == 404, "somebody else's"
        assert (await rig.http.delete(path, headers=headers)).status_code == 200
        assert await _refused(address(rig, returned)) == 403
        assert (await rig.http.delete(path, headers=headers)).status_code == 404
        assert rig.count("lockstep_bad_input_total", where="watch", reason="NotFound") == 5


async def test_a_page_of_another_site_cannot_use_a_ticket() -> None:
    async with running_rig(**RELAYED) as rig:
        used = await ticket(rig)
        assert await _refused(address(rig, used), Origin="https://evil.example") == 403
        assert rig.count("lockstep_bad_input_total", where="watch", reason="OriginRefused") == 1
        async with joined(address(rig, used)) as socket:
            await TestLine(socket, {}).until(lambda each: isinstance(each, Welcome))


async def test_a_ticket_that_nobody_uses_gives_its_place_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "lockstep.server.peers.websocket_transport.TICKET_SECONDS", 2.0
    )  # a slow machine asks twice within it
    async with running_rig(**RELAYED, max_relayed=1, reserved_places=0) as rig:
        used = await ticket(rig)
        full = await rig.http.post("/api/watch?relay=0", headers=rig.token("observer"))
        assert (full.status_code, full.json()["error"]) == (503, "too_many_peers")
        await eventually(lambda: len(rig.dependencies.console.peers) == 0)
        assert rig.count("lockstep_peers_ended_total", why="never connected") == 1
        assert await _refused(address(rig, used)) == 403
        await ticket(rig)


async def test_hundreds_of_tickets_cost_one_link_its_own_places_and_nobody_elses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "lockstep.server.peers.websocket_transport.TICKET_SECONDS", 600.0
    )  # none ends meanwhile, however slow the machine
    async with running_rig(**RELAYED, max_unconnected=20) as rig:
        headers = rig.token("observer")
        answers = [await rig.http.post("/api/watch?relay=0", headers=headers) for _ in range(300)]
        assert [each.status_code for each in answers].count(201) == 20
        assert {each.json()["error"] for each in answers if each.status_code != 201} == {"too_many_requests"}
        assert len(rig.dependencies.console.peers) == 20
        async with open_line(rig) as line:
            await line.until(lambda each: isinstance(each, Welcome))


async def test_bad_messages_are_named_and_counted_and_in_the_end_the_line_is_closed() -> None:
    async with running_rig(**RELAYED, max_bad_messages=5) as rig, open_line(rig) as line:
        bad: list[tuple[str | bytes, str]] = [
            (b"binary", "binary"),
            ("{", "malformed"),
            ('{"type":"welcome"}', "malformed"),
            ("x" * (MAX_MESSAGE + 1), "too_large"),
            ("[" * 10_000, "malformed"),
        ]
        for data, name in bad:
            await line.socket.send(data)
            await line.until(
                lambda each, name=name: isinstance(each, Refusal) and each.detail.startswith(name)  # type: ignore[misc]
            )
            line.heard.clear()
        assert rig.count("lockstep_bad_input_total", where="line", reason="malformed") == 3
        with suppress(ConnectionClosed):
            while True:  # on a slow machine the first of them are forgiven by now
                await line.socket.send("{")
                await asyncio.sleep(0)  # the console is in this process: it has to read
        assert await line.ended() == (1008, "bad messages")
        assert rig.count("lockstep_peers_ended_total", why="bad messages") == 1


async def test_a_flood_is_not_answered_and_a_stop_in_it_is_heard() -> None:
    async with running_rig(**RELAYED, max_observer_rate=10, max_bad_messages=50) as rig, open_line(rig) as line:
        for number in range(40):
            await line.send(Ping(id=number))
        await line.send(Stop(reason="flooded"))
        await line.until(lambda each: isinstance(each, StopStateNotice) and each.stop.stopped)
        assert rig.count("lockstep_bad_input_total", where="line", reason="flood") >= 20
        for number in range(60):
            await line.send(Ping(id=number))
        assert await line.ended() == (1008, "bad messages")


async def _until_too_much(rig: Rig, line: TestLine, name: str) -> None:
    await line.ended()
    await eventually(lambda: len(rig.dependencies.console.peers) == 0)
    assert rig.count("lockstep_bad_input_total", where="transport", reason=name) == 1
    assert rig.count("lockstep_peers_ended_total", why="too much") == 1


async def test_a_message_that_is_far_too_long_ends_the_line() -> None:
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        await line.socket.send("x" * 100_000)
        await _until_too_much(rig, line, "too_large")


async def test_text_that_is_none_ends_the_line() -> None:
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        line.socket.transport.write(Frame(Opcode.TEXT, b"\xff\xfe").serialize(mask=True))
        await _until_too_much(rig, line, "not_utf8")


async def test_pings_and_fragments_without_end_end_the_line() -> None:
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        ping = Frame(Opcode.PING, b"x" * 100).serialize(mask=True)
        line.socket.transport.write(ping * (int(CONTROL_BURST) + 20))
        await _until_too_much(rig, line, "too_many_frames")
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        fragment = Frame(Opcode.CONT, b"", fin=False).serialize(mask=True)
        begin = Frame(Opcode.TEXT, b"", fin=False).serialize(mask=True)
        line.socket.transport.write(begin + fragment * (MAX_FRAGMENTS + 1))
        await _until_too_much(rig, line, "too_many_frames")


async def test_who_connects_and_says_nothing_is_closed_after_twice_the_silence() -> None:
    async with running_rig(**RELAYED, peer_silence=0.1) as rig, open_line(rig) as line:
        assert await line.ended() == (1000, "silent")
        assert rig.count("lockstep_peers_ended_total", why="silent") == 1


async def test_a_socket_that_never_asks_for_anything_is_no_line() -> None:
    async with running_rig(**RELAYED, request_timeout=0.1) as rig:
        used = await ticket(rig)
        host, port = rig.url.removeprefix("http://").split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(f"GET /watch/{used} HTTP/1.1\r\nHost: {host}\r\n".encode())  # a head without an end
        async with asyncio.timeout(PATIENCE):
            assert await reader.read() == b""
        writer.close()
        async with joined(address(rig, used)) as websocket:
            await TestLine(websocket, {}).until(lambda each: isinstance(each, Welcome))


async def test_a_remote_that_does_not_read_is_closed_and_costs_the_others_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("lockstep.server.peers.websocket_transport.READ_SECONDS", 0.5)
    async with running_rig(**RELAYED) as rig, open_line(rig) as reader:
        headers = rig.token("observer")
        small = socket.socket()
        small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        host, port = rig.url.removeprefix("http://").split(":")
        small.connect((host, int(port)))
        async with connect(
            address(rig, await ticket(rig, headers)), sock=small, proxy=None, ping_interval=None, close_timeout=0.1
        ) as deaf:
            deaf.transport.pause_reading()
            console = rig.dependencies.console
            peer = next(each for each in console.peers if each.identity.token_id != _token_of(reader, rig))
            await eventually(lambda: peer.liveness.connected)
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(reader.until(lambda each: each == Pong(id=3)))  # it reads all the time
                for number in range(4000):
                    console.peers.announce(_note(number))
                    await asyncio.sleep(0)
                await eventually(lambda: rig.count("lockstep_peers_ended_total", why="does not read") == 1)
                assert rig.count("lockstep_dropped_total", queue="channel") > 0
                await reader.send(Ping(id=3))
            deaf.transport.abort()


def _token_of(line: TestLine, rig: Rig) -> str:
    return rig.access.bearer(line.headers["Authorization"]).token_id


def _note(number: int) -> SharedNote:
    return SharedNote(id=number, peer="p", name="n", role="observer", text="x" * 500, epoch="e", event=1, time=0.0)


async def test_a_line_ends_at_once_when_its_link_is_revoked_and_says_why() -> None:
    async with running_rig(**RELAYED) as rig:
        operator = rig.token("operator")
        invited = await rig.http.post("/api/invitations", json={"role": "observer", "name": "Bob"}, headers=operator)
        token = invited.json()["link"].split("token=")[1].split("&")[0]
        headers = {"Authorization": f"Bearer {token}"}
        waiting = await ticket(rig, headers)
        async with open_line(rig, headers) as line:
            await line.until(lambda each: isinstance(each, Welcome))
            gone = await rig.http.delete(f"/api/invitations/{invited.json()['id']}", headers=operator)
            assert gone.status_code == 200
            assert await line.ended() == (1008, "link revoked")
        assert await _refused(address(rig, waiting)) == 403
        again = await rig.http.post("/api/watch?relay=0", headers=headers)
        assert (again.status_code, again.json()["error"]) == (401, "link_revoked")


async def test_lines_end_with_the_console_and_are_told_so() -> None:
    async with running_rig(**RELAYED) as rig:
        socket = await connect(address(rig, await ticket(rig)), proxy=None)
        line = TestLine(socket, {})
        await line.until(lambda each: isinstance(each, Welcome))
        ending = asyncio.create_task(line.ended())
    assert (await ending)[0] in (1001, 1012)
    await socket.close()


async def test_who_closes_the_line_leaves_at_once() -> None:
    async with running_rig(**RELAYED) as rig:
        async with open_line(rig) as line:
            await line.until(lambda each: isinstance(each, Welcome))
        await eventually(lambda: len(rig.dependencies.console.peers) == 0)
        assert rig.count("lockstep_peers_ended_total", why="line closed") == 1


async def test_nothing_is_compressed_on_a_line() -> None:
    async with running_rig(**RELAYED) as rig, open_line(rig) as line:
        response = line.socket.response
        assert response is not None
        assert "Sec-WebSocket-Extensions" not in response.headers
