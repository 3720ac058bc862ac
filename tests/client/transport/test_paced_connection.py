"""A WebSocket to a peer that floods it, with a socket of the test."""

import asyncio

import pytest
from websockets.client import ClientProtocol
from websockets.protocol import State
from websockets.uri import parse_uri

from lockstep.client.transport.message_turns import MAX_UNREAD
from lockstep.client.transport.paced_connection import PacedConnection
from lockstep.protocol.pacing.paced_reader import PIECE

EMPTY = b"\x81\x00"  # a text frame without data
PING = b"\x89\x00"
LAST = b"\x81\x04last"


class Socket(asyncio.Transport):
    """A TCP connection whose peer reads nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.paused = False
        self.unsent = 0
        self.aborted = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.unsent += len(data)

    def get_write_buffer_size(self) -> int:
        return self.unsent

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...

    def abort(self) -> None:
        self.aborted = True

    def close(self) -> None: ...

    def can_write_eof(self) -> bool:
        return False

    def is_closing(self) -> bool:
        return self.aborted

    def pause_reading(self) -> None:
        self.paused = True

    def resume_reading(self) -> None:
        self.paused = False


class Parsed(ClientProtocol):
    """Counts the bytes that have been parsed."""

    count = 0

    def receive_data(self, data: bytes | bytearray) -> None:
        self.count += len(data)
        super().receive_data(data)


def connected() -> tuple[PacedConnection, Parsed, Socket]:
    protocol, socket = Parsed(parse_uri("ws://a/"), state=State.OPEN), Socket()
    connection = PacedConnection(protocol, max_queue=MAX_UNREAD)
    connection.response = object()  # type: ignore[assignment]
    connection.connection_made(socket)
    return connection, protocol, socket


@pytest.mark.parametrize("frame", [EMPTY, PING])
async def test_of_a_flood_one_piece_is_parsed_in_a_turn_and_the_socket_is_not_read_meanwhile(
    monkeypatch: pytest.MonkeyPatch, frame: bytes
) -> None:
    monkeypatch.setattr("lockstep.protocol.pacing.paced_reader.READ_TURN", 1e-9)
    connection, protocol, socket = connected()
    connection.data_received(frame * 100_000)
    assert protocol.count == PIECE
    assert socket.paused
    connection.connection_lost(None)
    await asyncio.sleep(0)
    assert protocol.count == PIECE


async def test_messages_that_wait_for_the_reader_keep_further_ones_unparsed_until_it_has_taken_them() -> None:
    connection, protocol, socket = connected()
    connection.data_received(EMPTY * PIECE + LAST)
    parsed = protocol.count
    assert MAX_UNREAD * len(EMPTY) < parsed <= PIECE
    assert socket.paused is True
    async with asyncio.timeout(20):
        while await connection.recv() != "last":
            pass
    assert (protocol.count, socket.paused) == (PIECE * len(EMPTY) + len(LAST), False)
    connection.connection_lost(None)


async def test_a_peer_that_pings_and_reads_no_answer_loses_the_connection_before_its_answers_fill_the_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bound, pong = 20_000, 6  # bytes
    monkeypatch.setattr("lockstep.client.transport.paced_connection.MAX_UNSENT", bound)
    connection, _, socket = connected()
    for _ in range(bound):
        connection.data_received(PING * 500)
        await asyncio.sleep(0)
        if socket.aborted:
            break
    assert socket.aborted
    assert bound < socket.unsent <= bound + PIECE // len(PING) * pong
    connection.connection_lost(None)
