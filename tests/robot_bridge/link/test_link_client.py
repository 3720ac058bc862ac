import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
import uvloop

from lockstep.protocol.errors import HandshakeError, LinkError, LinkLost, LinkRefused
from lockstep.protocol.framing import MAX_CONTROL_FRAME, FrameReader, frame
from lockstep.protocol.messages import (
    Command,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    LinkMessage,
    Media,
    Ping,
    Refusal,
    Rest,
    decode_message,
    encode_message,
)
from lockstep.robot_bridge.link import heartbeats
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.link.link_inbox import MAX_INBOX
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.robot_bridge.bridge_helpers import RecordingRobot, operator, running_bridge

HELLO = Hello(role="robot", epoch="e1", description=DESCRIPTION)


def wire(*messages: LinkMessage) -> bytes:
    return b"".join(frame(encode_message(message)) for message in messages)


NOTICE = wire(EventNotice(event=1, time=1.0))


class FakeBridge:
    """Answers any first bytes with given bytes, and waits for the client to hang up."""

    def __init__(self, answer: bytes, hang_up: bool) -> None:
        self.port = 0
        self.asked = asyncio.Event()
        self.left = asyncio.Event()  # the client hung up, after it had read everything
        self._answer = answer
        self._hang_up = hang_up

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1)
        self.asked.set()
        writer.write(self._answer)
        if not self._hang_up:
            with contextlib.suppress(ConnectionError):
                await reader.read(-1)
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()
        self.left.set()


@asynccontextmanager
async def fake_bridge(answer: bytes, hang_up: bool = False) -> AsyncIterator[FakeBridge]:
    bridge = FakeBridge(answer, hang_up)
    server = await asyncio.start_server(bridge.serve, "127.0.0.1", 0)
    async with server, asyncio.timeout(20):
        bridge.port = server.sockets[0].getsockname()[1]
        yield bridge
        await bridge.left.wait()


async def test_it_knows_the_bridges_epoch_and_description() -> None:
    async with running_bridge() as bridge, RobotLink(*bridge.address, "operator") as link:
        assert link.connected
        assert link.hello.epoch == bridge.epoch
        assert link.hello.description == bridge.description
    assert not link.connected


async def test_before_connecting_there_is_nothing_to_read_or_send() -> None:
    link = RobotLink("127.0.0.1", 1, "operator")
    with pytest.raises(LinkLost, match="not connected"):
        _ = link.hello
    with pytest.raises(LinkLost):
        link.send(Rest(event=1))
    await link.close()


async def test_nobody_listening_is_a_lost_link_with_the_address() -> None:
    server = await asyncio.start_server(lambda *_: None, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    server.close()
    await server.wait_closed()
    with pytest.raises(LinkLost, match=f"127.0.0.1:{port}"):
        await RobotLink("127.0.0.1", port, "operator").connect()


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (wire(Goodbye(error="taken", detail="by Ada")), LinkRefused),
        (wire(Goodbye(error="version")), HandshakeError),
        (wire(Goodbye(error="full")), LinkRefused),
        (wire(Feedback(event=1, issue=1, time=0.0, axes=[])), HandshakeError),
        (wire(Hello(role="robot", epoch="e", version=7, description=DESCRIPTION)), HandshakeError),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", HandshakeError),
        (b"SSH-2.0-OpenSSH_9.2\r\n", HandshakeError),
    ],
)
async def test_an_answer_that_is_no_welcome_is_an_error_of_its_kind(answer: bytes, error: type[LinkError]) -> None:
    async with fake_bridge(answer) as bridge:
        with pytest.raises(error):
            await RobotLink("127.0.0.1", bridge.port, "operator").connect()


async def test_a_bridge_that_hangs_up_during_the_handshake_is_a_lost_link() -> None:
    async with fake_bridge(b"", hang_up=True) as bridge:
        with pytest.raises(LinkLost):
            await RobotLink("127.0.0.1", bridge.port, "operator").connect()


async def test_cancelling_a_connect_leaves_nothing_behind() -> None:
    async with fake_bridge(b"") as bridge:
        connecting = asyncio.ensure_future(RobotLink("127.0.0.1", bridge.port, "operator").connect())
        await bridge.asked.wait()
        connecting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await connecting


async def test_messages_before_the_end_are_read_and_then_the_reason_is_raised() -> None:
    refusal = Refusal(event=2, reason="late", current=1)
    async with (
        fake_bridge(wire(HELLO, refusal, Goodbye(error="closing", detail="bye"))) as bridge,
        RobotLink("127.0.0.1", bridge.port, "operator") as link,
    ):
        assert await anext(link) == refusal
        with pytest.raises(LinkLost, match="closing: bye"):
            await anext(link)
        with pytest.raises(LinkLost):
            link.send(Rest(event=1))


async def test_delivered_messages_come_in_their_order_those_that_waited_first_and_then_the_reason() -> None:
    refusals = [Refusal(event=number, reason="late", current=1) for number in range(2, 6)]
    got: list[LinkMessage] = []
    async with (
        fake_bridge(wire(HELLO, *refusals, Goodbye(error="closing", detail="bye"))) as bridge,
        RobotLink("127.0.0.1", bridge.port, "operator") as link,
    ):
        with pytest.raises(LinkLost, match="closing: bye"):
            await link.deliver(got.append)
    assert got == refusals


async def test_a_message_is_delivered_in_the_turn_that_it_comes_in() -> None:
    """Nothing that became ready in between, a slice of work for observers say, is done before it."""
    turns: list[str] = []
    async with running_bridge() as bridge, RobotLink(*bridge.address, "operator") as link:
        received = link._transport.data_received
        ended = asyncio.Event()

        def data_received(data: bytes) -> None:
            asyncio.get_running_loop().call_soon(turns.append, "ready since")
            turns.append("came")
            received(data)

        def take(message: LinkMessage) -> None:
            turns.append("delivered")
            if turns.count("delivered") == 3:
                ended.set()

        link._transport.data_received = data_received  # type: ignore[method-assign]
        delivering = asyncio.create_task(link.deliver(take))
        async with asyncio.timeout(20):
            await ended.wait()
        await link.close()
        await delivering
    first = turns.index("came")
    assert turns[first : first + 2] == ["came", "delivered"]


async def test_what_a_taker_raises_ends_the_delivery_and_nothing_more_is_handed_over() -> None:
    refusals = [Refusal(event=number, reason="late", current=1) for number in range(2, 6)]
    got: list[LinkMessage] = []

    def take(message: LinkMessage) -> None:
        got.append(message)
        raise RuntimeError("a fault of ours")

    async with (
        fake_bridge(wire(HELLO, *refusals)) as bridge,
        RobotLink("127.0.0.1", bridge.port, "operator") as link,
    ):
        with pytest.raises(RuntimeError, match="a fault of ours"):
            await link.deliver(take)
    assert got == refusals[:1]


async def test_its_socket_can_be_watched_by_others_while_it_is_open() -> None:
    async with running_bridge() as bridge:
        link = RobotLink(*bridge.address, "operator")
        assert link.fileno() == -1
        async with link:
            assert link.fileno() > 0
        assert link.fileno() == -1


async def test_a_silent_bridge_is_lost_after_a_second() -> None:
    async with fake_bridge(wire(HELLO)) as bridge, RobotLink("127.0.0.1", bridge.port, "operator") as link:
        with pytest.raises(LinkLost, match="silent"):
            await anext(link)


async def test_iterating_ends_when_the_link_is_closed_here() -> None:
    async with running_bridge() as bridge:
        link = RobotLink(*bridge.address, "events")
        await link.connect()

        async def read_all() -> int:
            return len([message async for message in link])

        reading = asyncio.ensure_future(read_all())
        await asyncio.sleep(0)
        await link.close()
        await link.close()
        assert await reading >= 0


async def test_bad_input_from_the_bridge_is_counted_and_skipped() -> None:
    notice = EventNotice(event=1, time=0.0)
    async with (
        fake_bridge(wire(HELLO) + frame(b"\xc1") + wire(notice, Refusal(event=1, reason="late", current=1))) as bridge,
        RobotLink("127.0.0.1", bridge.port, "operator") as link,
    ):
        assert isinstance(await anext(link), Refusal)
        assert link.bad_input == {"malformed": 1, "not_allowed": 1}


async def test_a_reader_that_falls_behind_loses_the_oldest_and_knows_how_many() -> None:
    count = MAX_INBOX + 10
    axes, joints = ([0.0] * len(each) for each in (DESCRIPTION.axes, DESCRIPTION.joints))
    feedbacks = [Feedback(event=n, issue=1, time=0.0, axes=axes, joints=joints) for n in range(1, count + 1)]
    async with (
        fake_bridge(wire(HELLO, *feedbacks, Goodbye(error="closing"))) as bridge,
        RobotLink("127.0.0.1", bridge.port, "operator") as link,
    ):
        await bridge.left.wait()
        received = [await anext(link) for _ in range(MAX_INBOX)]
        assert received == feedbacks[10:]
        assert link.drops == {"feedback": 10}


async def test_of_pictures_that_were_not_read_only_the_newest_is_kept() -> None:
    pictures = [Media(stream="a", codec="mjpeg", stamp=n, time=0.0, payload=b"") for n in range(1, 6)]
    async with (
        fake_bridge(wire(HELLO, *pictures, Goodbye(error="closing"))) as bridge,
        RobotLink("127.0.0.1", bridge.port, "media") as link,
    ):
        await bridge.left.wait()
        assert await anext(link) == pictures[-1]
        assert link.media_drops == {"a": 4}


async def test_the_round_trip_includes_a_tick_and_little_else() -> None:
    """The best of many: a busy machine may hold up the others, an algorithm of TCP's would hold up all."""
    async with running_bridge(RecordingRobot()) as bridge, operator(bridge) as driver:
        loop, trips = asyncio.get_running_loop(), list[float]()
        for _ in range(50):
            started = loop.time()
            await driver.drive()
            trips.append(loop.time() - started)
        assert min(trips) < 0.03


async def cancelled_as_it_opens() -> None:
    async with fake_bridge(wire(HELLO)) as bridge:
        link = RobotLink("127.0.0.1", bridge.port, "operator")
        connecting = asyncio.ensure_future(link.connect())
        made = link._transport.connection_made

        def cancel(transport: asyncio.BaseTransport) -> None:
            made(transport)
            connecting.cancel()

        link._transport.connection_made = cancel  # type: ignore[method-assign]
        with pytest.raises(asyncio.CancelledError):
            await connecting


@pytest.mark.parametrize("loop", [asyncio.new_event_loop, uvloop.new_event_loop])
def test_a_link_that_is_cancelled_as_it_opens_ends_as_cancelled(
    loop: Callable[[], asyncio.AbstractEventLoop],
) -> None:
    with asyncio.Runner(loop_factory=loop) as runner:
        runner.run(cancelled_as_it_opens())


async def test_closing_with_data_unread_does_not_reset_the_connection_and_the_bridge_gets_the_goodbye() -> None:
    # A reset makes the bridge's next write fail, and what it has not read is lost: it would keep the client's robot.
    loop = asyncio.get_running_loop()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        host, port = listener.getsockname()
        link = RobotLink(host, port, "operator")
        async with asyncio.timeout(20), asyncio.TaskGroup() as tasks:
            connecting = tasks.create_task(link.connect())
            bridge, _ = await loop.sock_accept(listener)
            with bridge:
                bridge.setblocking(False)
                await loop.sock_sendall(bridge, wire(HELLO))
                await connecting
                with contextlib.suppress(BlockingIOError):
                    while True:  # into the client's buffer, before its loop turns
                        bridge.send(NOTICE)
                closing = tasks.create_task(link.close())
                received = b""
                while data := await loop.sock_recv(bridge, 1 << 16):  # a reset raises
                    received += data
                for _ in range(3):  # a bridge that was busy writes on
                    await loop.sock_sendall(bridge, NOTICE)
            await closing
    assert received.endswith(wire(Goodbye(error="closing", detail="")))


async def test_closing_after_the_bridge_has_reset_the_connection_raises_nothing() -> None:
    class Reset(asyncio.Transport):
        def __init__(self) -> None:
            super().__init__()
            self.closed = False

        def can_write_eof(self) -> bool:
            return True

        def write_eof(self) -> None:
            raise OSError(107, "Transport endpoint is not connected")

        def write(self, data: bytes | bytearray | memoryview) -> None: ...

        def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...

        def close(self) -> None:
            self.closed = True

    link, transport = RobotLink("127.0.0.1", 1, "operator"), Reset()
    link._transport.connection_made(transport)
    link._transport.say_goodbye()
    assert transport.closed
    link._transport.connection_lost(None)


async def test_a_close_that_is_cancelled_leaves_no_connection_to_a_bridge_that_goes_on_sending() -> None:
    gone = asyncio.Event()

    async def send_for_ever(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(wire(HELLO))
        with contextlib.suppress(ConnectionError):
            while True:
                writer.write(NOTICE * 1000)
                await writer.drain()
        gone.set()
        writer.close()

    server = await asyncio.start_server(send_for_ever, "127.0.0.1", 0)
    async with server, asyncio.timeout(20):
        link = RobotLink("127.0.0.1", server.sockets[0].getsockname()[1], "events")
        await link.connect()
        closing = asyncio.ensure_future(link.close())
        await asyncio.sleep(0)
        closing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await closing
        await gone.wait()


async def test_a_command_without_feedback_is_asked_for_by_pings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heartbeats, "PING_INTERVAL", 1e9)  # only those that ask are left
    pinged = asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        frames = FrameReader(MAX_CONTROL_FRAME)
        writer.write(wire(HELLO))
        while data := await reader.read(4096):
            frames.feed(data)
            for payload in frames.frames():
                if isinstance(decode_message(payload), Ping):
                    pinged.set()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server, RobotLink("127.0.0.1", server.sockets[0].getsockname()[1], "operator") as link:
        assert not pinged.is_set()
        link.send(Command(event=2, issue=1, nonce=0, values=[0.0, 0.0, 0.0]))
        async with asyncio.timeout(20):
            await pinged.wait()
