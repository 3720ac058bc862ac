"""What the kernel says of a connection's queue."""

import asyncio
import socket
import struct
import sys
from contextlib import suppress
from typing import Any

import pytest

from lockstep.robot_bridge.link.sending.path_queue import BEHIND_AT, LENGTH, RTT_AT, UNKNOWN, PathQueue, path_queue


class Kernel:
    """Stands for a socket."""

    def __init__(self, info: bytes | OSError) -> None:
        self.info = info

    def getsockopt(self, level: int, name: int, length: int) -> bytes:
        if isinstance(self.info, OSError):
            raise self.info
        return self.info[:length]


def info(round_trip: int, shortest: int, unsent: int = 0) -> bytes:
    made = bytearray(LENGTH + 80)  # later kernels say more
    struct.pack_into("=I", made, RTT_AT, round_trip)
    struct.pack_into("=II", made, BEHIND_AT, unsent, shortest)
    return bytes(made)


pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux says")


@pytest.mark.parametrize(
    ("said", "queue"),
    [
        (info(120_000, 40_000, 4096), PathQueue(4096, 0.08)),
        (info(40_000, 41_000), PathQueue(0, 0.0)),
        (info(1000, UNKNOWN), PathQueue(0, 0.0)),
        (bytes(104), None),
        (OSError(95, "not supported"), None),
    ],
)
def test_a_round_trip_longer_than_the_shortest_is_a_queue(said: Any, queue: PathQueue | None) -> None:
    assert path_queue(Kernel(said)) == queue


def fill(writer: socket.socket) -> None:
    with suppress(BlockingIOError):
        while True:
            writer.send(bytes(1 << 16))


async def test_a_connection_whose_other_side_does_not_read_has_bytes_that_were_not_sent() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener, socket.socket() as writer:
        writer.setblocking(False)
        await asyncio.get_running_loop().sock_connect(writer, listener.getsockname())
        reader, _ = listener.accept()
        with reader:
            idle = path_queue(writer)
            assert idle is not None
            assert idle.unsent == 0
            fill(writer)
            found = path_queue(writer)
            assert found is not None
            assert found.unsent > 0


def test_what_is_no_tcp_says_nothing() -> None:
    with socket.socket(socket.AF_UNIX) as other:
        assert path_queue(other) is None
