"""Whoever is admitted and sends as fast as TCP takes it: the ticks go on, others drive and stop, memory is bounded."""

import asyncio
from collections.abc import Iterator
from contextlib import AbstractAsyncContextManager

import pytest

from lockstep.protocol.framing import frame
from lockstep.protocol.messages import (
    Command,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    Ping,
    Pong,
    Reset,
    Rest,
    Stop,
    StopTaken,
    encode_message,
)
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_server import READ_BURST, LinkPeer
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import DRIVE, RecordingRobot, operator, raw_link
from tests.robot_bridge.link.flood.flooding import flooding

FLOODING = """
import contextlib, os, socket, sys

os.nice(10)  # it stands for another machine, which takes no processor time of the bridge's
connection = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
connection.sendall(bytes.fromhex(sys.argv[2]))
said = bytes.fromhex(sys.argv[3])
block = said * max(1, 65536 // len(said))
connection.settimeout(0.01)
print("floods", flush=True)
with contextlib.suppress(ConnectionError):
    view = memoryview(block)
    while True:
        with contextlib.suppress(TimeoutError):
            view = view[connection.send(view):] or memoryview(block)
        connection.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while connection.recv(1 << 16):
                pass
        connection.settimeout(0.01)
"""


def flood(bridge: Bridge, role: LinkRole, said: bytes) -> AbstractAsyncContextManager[None]:
    return flooding(FLOODING, str(bridge.address[1]), frame(encode_message(Hello(role=role))).hex(), said.hex())


class CountingRobot(RecordingRobot):
    """Remembers the most messages that were read between two of its ticks."""

    def __init__(self) -> None:
        super().__init__()
        self.read = 0
        self.most = 0
        self.all = 0

    def tick(self) -> None:
        self.most, self.all, self.read = max(self.most, self.read), self.all + self.read, 0
        super().tick()


@pytest.fixture
def counting(monkeypatch: pytest.MonkeyPatch) -> CountingRobot:
    robot = CountingRobot()
    received = LinkPeer.received

    def counted(peer: LinkPeer, event: LinkMessage) -> None:
        robot.read += 1
        received(peer, event)

    monkeypatch.setattr(LinkPeer, "received", counted)
    return robot


def floods() -> Iterator[tuple[str, LinkRole, bytes]]:
    """Everything that a client may send, and what it may not."""
    yield "stops", "media", frame(encode_message(Stop(by="x", reason="y")))
    yield "repeated-stops", "events", frame(encode_message(Stop(press="f" * 32)))
    yield "forbidden", "events", frame(encode_message(Reset(number=7)))
    yield "foreign", "events", frame(encode_message(Pong(id=2**60)))
    yield "malformed", "media", frame(b"\xc1")
    yield "empty-maps", "media", frame(b"\x80")


@pytest.mark.parametrize(("role", "said"), [pytest.param(*rest, id=name) for name, *rest in floods()])
async def test_a_link_that_floods_keeps_nobody_from_driving_and_stopping(
    role: LinkRole, said: bytes, counting: CountingRobot
) -> None:
    stops = b"stop" in said
    async with Bridge(counting, BridgeSettings(port=0)) as bridge:
        async with operator(bridge) as driver, flood(bridge, role, said), asyncio.timeout(30):
            if b"pong" not in said:  # which the session keeps to itself
                await counting.until(lambda: counting.all > 200, "the flood arrives")
            for _ in range(0 if stops else 20):
                await driver.drive(DRIVE)
            async with raw_link(bridge, "events") as watcher:
                watcher.send(Stop(press="a" * 32))
                assert (await watcher.find(StopTaken)).press == "a" * 32
            await driver.heard(lambda feedback: feedback.stop.stopped and feedback.at_rest)
        assert counting.most <= 4 * READ_BURST, "one link had more than its turn"


async def test_an_operator_that_floods_gets_its_answers_and_the_stop_of_others_is_taken(
    counting: CountingRobot,
) -> None:
    said = b"".join(
        frame(encode_message(message))
        for message in (Command(event=7, issue=1, values=[9.0] * 256), Rest(event=2), Reset(number=3), Ping(id=1))
    )
    async with Bridge(counting, BridgeSettings(port=0)) as bridge:
        async with flood(bridge, "operator", said), raw_link(bridge, "media") as watcher:
            await counting.until(lambda: counting.all > 200, "the flood arrives")
            watcher.send(Stop(press="a" * 32))
            assert (await watcher.find(StopTaken)).press == "a" * 32
            assert bridge.counters.refusals["wrong_size"] > 0
        assert counting.most <= 4 * READ_BURST
        await counting.until(lambda: bridge.links == 0, "the bridge has read to the end what the flood left")
        async with operator(bridge, armed=False) as driver:
            await driver.heard(lambda feedback: feedback.stop.stopped)


async def test_the_largest_messages_are_read_no_faster_than_as_many_small_ones() -> None:
    """A mebibyte of fields that nobody knows."""
    junk = b"\x82\xa4type\xa4stop\xa1x\xc6" + (1_000_000).to_bytes(4, "big") + bytes(1_000_000)
    async with (
        Bridge(RecordingRobot(), BridgeSettings(port=0)) as bridge,
        operator(bridge) as driver,
        raw_link(bridge, "media") as link,
    ):
        link.writer.write(frame(junk) * 20)
        await driver.heard(lambda feedback: feedback.stop.stopped)
        began, first = driver.feedback.time, driver.feedback.stop.number
        await driver.heard(lambda feedback: feedback.time - began > 1.0)
        assert driver.feedback.stop.number - first <= 2, "each costs as much as a thousand small ones"


async def test_what_a_peer_says_as_goodbye_is_counted_by_the_names_that_there_are() -> None:
    async with Bridge(RecordingRobot(), BridgeSettings(port=0)) as bridge:
        for error in ("made-up-1", "made-up-2", "closing"):
            async with raw_link(bridge, "events") as link:
                link.send(Goodbye(error=error))
                while await link.next() is not None:  # an event may have been announced before
                    pass
        assert set(bridge.counters.endings) <= {"other", "closing"}
        assert bridge.counters.endings["other"] == 2
