"""A flood on one link, with a clock and a thread's work that the test decides."""

import asyncio

import pytest
from websockets.protocol import Protocol, Side

from lockstep.protocol.framing import frame
from lockstep.protocol.messages import Feedback, Hello, LinkMessage, encode_message
from lockstep.robot_bridge.link.link_session import BadInput, ClientSession
from lockstep.robot_bridge.link.paced_transport import (
    PIECE,
    READ_BURST,
    READ_SHARE,
    READ_TURN,
    PacedReader,
    PacedSocket,
    PacedTransport,
    ReadBudget,
)
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

HELLO = frame(encode_message(Hello(role="robot", epoch="e1", description=DESCRIPTION)))
GARBAGE = b"\x00\x00\x00\x01\xc1"


class Socket(asyncio.Transport):
    def __init__(self) -> None:
        super().__init__()
        self.pauses = 0

    def write(self, data: bytes | bytearray | memoryview) -> None: ...
    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...
    def close(self) -> None: ...
    def abort(self) -> None: ...

    def pause_reading(self) -> None:
        self.pauses += 1

    def resume_reading(self) -> None: ...

    def was_paused(self) -> bool:
        return self.pauses > 0


class Link(PacedTransport):
    """Each message costs `cost` seconds of the thread's time; the clock stands still."""

    def __init__(self, cost: float) -> None:
        self.cost = cost
        self.busy = 0.0
        self.heard: list[LinkMessage | BadInput] = []
        super().__init__(ClientSession(0.0, "operator"), lambda: 0.0, lambda: self.busy)
        self.tcp = Socket()
        self.connection_made(self.tcp)
        self.data_received(HELLO)
        self.heard.clear()

    def received(self, event: LinkMessage | BadInput) -> None:
        self.heard.append(event)
        self.busy += self.cost


async def test_what_fits_is_read_at_once_and_in_order() -> None:
    link = Link(0.0)
    link.data_received(GARBAGE * PIECE)
    assert len(link.heard) == PIECE
    assert not link.tcp.was_paused()


async def test_a_flood_is_read_in_turns_and_waits_when_its_share_is_used_up() -> None:
    link = Link(READ_TURN)
    pieces = int(READ_BURST / READ_TURN) + 5
    link.data_received(GARBAGE)
    assert not link.tcp.was_paused()
    link.data_received(GARBAGE * (pieces * PIECE // len(GARBAGE)))
    assert len(link.heard) <= PIECE // len(GARBAGE) + 2, "one piece, and others have their turn"
    assert link.tcp.was_paused()
    await asyncio.sleep(0)
    link.connection_lost(None)
    read = len(link.heard)
    await asyncio.sleep(0)
    assert len(link.heard) == read, "nothing is read after the end"


async def test_a_message_in_pieces_is_whole() -> None:
    link = Link(0.0)
    feedback = Feedback(
        event=1,
        issue=1,
        time=0.0,
        axes=[0.0] * len(DESCRIPTION.axes),
        joints=[0.0] * len(DESCRIPTION.joints),
        faults=["f" * 500] * 60,
    )
    message = frame(encode_message(feedback))
    assert len(message) > PIECE
    link.data_received(message)
    assert link.heard == [feedback]


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
