"""The robot's WebSocket to its console, with a socket of the test."""

import asyncio

import pytest
from websockets.client import ClientProtocol
from websockets.protocol import State
from websockets.uri import parse_uri

from lockstep.protocol.pacing.paced_reader import PIECE
from lockstep.robot_bridge.dial.console_connection import MAX_PINGS, ConsoleConnection

EMPTY = b"\x82\x00"  # a binary frame without data, as a console sends it
PING = b"\x89\x00"


class Socket(asyncio.Transport):
    paused = False
    aborted = False

    def write(self, data: bytes | bytearray | memoryview) -> None: ...
    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...
    def close(self) -> None: ...

    def abort(self) -> None:
        self.aborted = True

    def can_write_eof(self) -> bool:
        return False

    def is_closing(self) -> bool:
        return False

    def pause_reading(self) -> None:
        self.paused = True

    def resume_reading(self) -> None:
        self.paused = False


class Link(asyncio.Protocol):
    messages = 0

    def data_received(self, data: bytes) -> None:
        self.messages += 1


async def test_a_console_that_floods_its_robot_with_empty_frames_has_a_piece_read_in_a_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("lockstep.protocol.pacing.paced_reader.READ_TURN", 1e-9)
    connection = ConsoleConnection(ClientProtocol(parse_uri("ws://a/"), state=State.OPEN), for_link=True)
    connection.response = object()  # type: ignore[assignment]
    socket, link = Socket(), Link()
    connection.connection_made(socket)
    connection.carry(link)
    connection.data_received(EMPTY * 100_000)
    assert 0 < link.messages <= PIECE // len(EMPTY)
    assert socket.paused
    read = link.messages
    connection.eof_received()
    connection.connection_lost(None)
    await asyncio.sleep(0)
    assert link.messages == read


async def test_a_console_that_pings_and_takes_no_answers_loses_the_link_and_one_that_takes_them_does_not() -> None:
    connection = ConsoleConnection(ClientProtocol(parse_uri("ws://a/"), state=State.OPEN), for_link=True)
    connection.response = object()  # type: ignore[assignment]
    socket, link = Socket(), Link()
    connection.connection_made(socket)
    connection.carry(link)
    connection.data_received(PING * 2 * MAX_PINGS)
    connection.pause_writing()
    connection.data_received(PING * MAX_PINGS)
    connection.resume_writing()
    connection.pause_writing()
    connection.data_received(PING * MAX_PINGS)
    before = socket.aborted
    connection.data_received(PING)
    assert (before, socket.aborted) == (False, True)
    connection.connection_lost(None)
