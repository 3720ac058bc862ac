import asyncio
from collections.abc import Callable

import pytest

from lockstep.protocol.pacing.paced_reader import PacedReader
from lockstep.protocol.pacing.paced_socket import PacedSocket
from lockstep.server.util.read_turns import ReadTurns
from tests.protocol.pacing.tcp_socket import Socket


class Time:
    """The thread works for as long as a reader says, and the clock goes with it."""

    def __init__(self) -> None:
        self.now = 0.0


class Client:
    def __init__(self, time: Time, turns: ReadTurns, cost: float) -> None:
        self.pieces = 0
        self.read = asyncio.Event()

        def take(data: bytes) -> None:
            self.pieces += 1
            time.now += cost
            self.read.set()

        self.socket = Socket()
        self.reader = PacedReader(take, share=0.05, burst=0.05, turns=turns, clock=clock(time), worked=clock(time))
        self.paced = PacedSocket(self.socket, self.reader)


def clock(time: Time) -> Callable[[], float]:
    return lambda: time.now


async def test_while_there_is_time_each_reads_at_once() -> None:
    time = Time()
    turns = ReadTurns(0.1, 0.01, clock(time))
    clients = [Client(time, turns, 0.001) for _ in range(5)]
    for client in clients:
        client.reader.feed(b"data")
    assert [client.pieces for client in clients] == [1] * 5


async def test_many_connections_together_take_no_more_than_their_share_and_none_starves() -> None:
    time, seconds = Time(), 10.0
    turns = ReadTurns(0.1, 0.01, clock(time))
    clients = [Client(time, turns, 0.001) for _ in range(50)]
    loop = asyncio.get_running_loop()
    real, loop.time = loop.time, clock(time)  # type: ignore[method-assign]
    try:
        for client in clients:
            client.reader.feed(b"x" * 10_000_000)
        while time.now < seconds:
            before = time.now
            await asyncio.sleep(0)
            assert time.now - before <= 0.0021, "one turn in an iteration of the loop"
            time.now += 0.0005  # of all else
    finally:
        loop.time = real  # type: ignore[method-assign]
    pieces = [client.pieces for client in clients]
    assert sum(pieces) * 0.001 <= seconds * 0.1 + 0.1
    assert sum(pieces) * 0.001 >= seconds * 0.05
    assert min(pieces) >= max(pieces) - 2
    for client in clients:
        client.reader.end()


@pytest.mark.parametrize("end", ["end", "allow"])
async def test_who_leaves_or_gets_a_budget_of_its_own_waits_for_no_turn(end: str) -> None:
    time = Time()
    turns = ReadTurns(0.1, 0.0, clock(time))
    first, other = Client(time, turns, 0.001), Client(time, turns, 0.001)
    first.reader.feed(b"data")
    other.reader.feed(b"data")
    assert (other.pieces, other.socket.was_paused()) == (0, True)
    if end == "end":
        other.reader.end()
    else:
        other.reader.allow(0.25, 0.1)
        async with asyncio.timeout(10):
            await other.read.wait()
    time.now += 1.0
    assert turns.is_free, "nobody waits"


async def test_a_pause_while_a_reader_waits_for_its_turn_is_kept_and_ends() -> None:
    time = Time()
    turns = ReadTurns(0.1, 0.0, clock(time))
    first, other = Client(time, turns, 0.001), Client(time, turns, 0.001)
    first.reader.feed(b"data")
    other.reader.feed(b"data")
    other.paced.pause_reading()
    time.now += 1.0
    await asyncio.sleep(0.05)
    assert other.pieces == 0
    other.paced.resume_reading()
    async with asyncio.timeout(10):
        await other.read.wait()
