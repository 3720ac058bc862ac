"""A flood on one connection, with a clock and a thread's work that the test decides."""

import asyncio

import pytest
from websockets.protocol import Protocol, Side

from lockstep.protocol.pacing.paced_reader import (
    PIECE,
    READ_BURST,
    READ_SHARE,
    READ_TURN,
    PacedReader,
    ReadBudget,
)
from lockstep.protocol.pacing.paced_socket import PacedSocket
from tests.protocol.pacing.tcp_socket import Socket


@pytest.mark.parametrize("seconds", [1.0, 10.0])
def test_a_budget_gives_its_share_of_the_time_and_no_more(seconds: float) -> None:
    budget, now, worked = ReadBudget(READ_SHARE, READ_BURST, 0.0), 0.0, 0.0
    while now < seconds:
        wait = budget.spend(0.01, now)
        worked += 0.01
        now += wait if wait > 0 else 0.0
    assert worked == pytest.approx(READ_BURST + READ_SHARE * seconds, abs=0.03)
    assert budget.spend(0.0, now + 1000.0) == 0.0
    assert budget.spend(2 * READ_BURST, now + 1000.0) == pytest.approx(READ_BURST / READ_SHARE), (
        "idle time is not saved"
    )


class Frames:
    """A WebSocket whose every frame costs `cost` seconds of the thread's time; the clock stands still."""

    def __init__(self, cost: float) -> None:
        self.cost = cost
        self.busy = 0.0
        self.count = 0
        self.protocol = Protocol(Side.SERVER)
        self.tcp = Socket()
        self.reader = PacedReader(self.parse, clock=lambda: 0.0, worked=lambda: self.busy)
        self.socket = PacedSocket(self.tcp, self.reader)

    def parse(self, data: bytes) -> None:
        self.protocol.receive_data(data)
        frames = len(self.protocol.events_received())
        self.count += frames
        self.busy += frames * self.cost


EMPTY = b"\x82\x80\x00\x00\x00\x00"  # 6 bytes: a frame without data, which no message of a link comes from


async def test_frames_without_data_cost_the_budget_what_they_take_to_parse() -> None:
    frames = Frames(READ_TURN / 100)
    frames.reader.feed(EMPTY * 100_000)
    assert 0 < frames.count <= PIECE // len(EMPTY) + 1, "one piece, and others have their turn"
    assert frames.tcp.was_paused()
    frames.reader.end()
    read = frames.count
    frames.reader.feed(EMPTY)
    await asyncio.sleep(0)
    assert frames.count == read, "nothing is read after the end"


async def test_whoever_takes_the_data_pauses_the_reader_and_loses_nothing() -> None:
    frames = Frames(0.0)
    frames.socket.pause_reading()
    frames.reader.feed(EMPTY * 10)
    assert (frames.count, frames.tcp.was_paused()) == (0, True)
    frames.socket.resume_reading()
    await asyncio.sleep(0)
    assert frames.count == 10


async def test_a_fault_of_whoever_takes_the_data_ends_the_connection_in_a_later_turn_too() -> None:
    """Else it stays paused, with nobody to go on."""
    aborted, faults = asyncio.Event(), 0

    class Tcp(Socket):
        def abort(self) -> None:
            aborted.set()

    def take(data: bytes) -> None:
        raise ValueError

    def told(loop: asyncio.AbstractEventLoop, context: dict[str, object]) -> None:
        nonlocal faults
        faults += isinstance(context["exception"], ValueError)

    asyncio.get_running_loop().set_exception_handler(told)
    reader = PacedReader(take)
    socket = PacedSocket(Tcp(), reader)
    socket.pause_reading()
    reader.feed(b"data")
    socket.resume_reading()
    async with asyncio.timeout(10):
        await aborted.wait()
    assert faults == 1
    reader.feed(b"data")
    await asyncio.sleep(0)
    assert faults == 1, "nothing is read after that"


@pytest.mark.parametrize("end", ["close", "abort"])
async def test_what_comes_after_this_sides_end_is_dropped(end: str) -> None:
    frames = Frames(READ_TURN)
    frames.reader.feed(EMPTY * 100_000)
    read = frames.count
    getattr(frames.socket, end)()
    await asyncio.sleep(0)
    assert frames.count == read
