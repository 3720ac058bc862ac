"""One end of a link on a transport whose fullness the test decides."""

import asyncio

from lockstep.protocol.framing import FrameReader, frame
from lockstep.protocol.messages import (
    Goodbye,
    Hello,
    LinkMessage,
    Media,
    Ping,
    Pong,
    Stop,
    decode_message,
    encode_message,
)
from lockstep.robot_bridge.link.link_session import BadInput, BridgeSession
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.link.message_rate import MessageRate
from tests.makers import feedback

HELLO = Hello(role="robot", epoch="e1")


class FakeTransport(asyncio.Transport):
    """Takes `room` bytes; buffers the rest."""

    def __init__(self) -> None:
        super().__init__()
        self.reader = FrameReader(1 << 24)
        self.buffered = 0
        self.closed = False
        self.aborts = 0
        self.reads = True

    def is_closing(self) -> bool:
        return self.closed

    def pause_reading(self) -> None:
        self.reads = False

    def resume_reading(self) -> None:
        self.reads = True

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.reader.feed(bytes(data))

    def written(self) -> list[LinkMessage]:
        return [decode_message(payload) for payload in self.reader.frames()]

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        pass

    def get_write_buffer_size(self) -> int:
        return self.buffered

    def close(self) -> None:
        self.closed = True

    def abort(self) -> None:
        self.aborts += 1


class Endpoint(LinkTransport):
    """The bridge's side at a time the test sets."""

    def __init__(self, budget: MessageRate | None = None) -> None:
        self.now = 0.0
        super().__init__(BridgeSession(0.0, lambda hello: HELLO), lambda: self.now, budget)
        self.events: list[LinkMessage | BadInput] = []
        self.times_lost = 0
        self.tcp = FakeTransport()
        self.connection_made(self.tcp)

    def received(self, event: LinkMessage | BadInput) -> None:
        self.events.append(event)
        if isinstance(event, Stop):
            self.send(feedback(1))

    def lost(self) -> None:
        self.times_lost += 1

    def hear(self, *messages: LinkMessage) -> None:
        self.data_received(b"".join(frame(encode_message(message)) for message in messages))

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.now += 0.05
            self.tick()


def picture(stamp: int) -> Media:
    return Media(stream="a", codec="mjpeg", stamp=stamp, time=0.0, payload=b"")


def opened() -> Endpoint:
    end = Endpoint()
    end.hear(Hello(role="operator"))
    assert end.tcp.written() == [HELLO]
    return end


def test_our_hello_goes_before_the_answers_to_what_came_with_theirs() -> None:
    end = Endpoint()
    end.hear(Hello(role="operator"), Stop(), Ping(id=3))
    assert end.tcp.written() == [HELLO, Pong(id=3), feedback(1)]


def test_while_the_socket_is_full_only_the_newest_of_each_kind_waits() -> None:
    end = opened()
    end.pause_writing()
    for event in range(1, 6):
        end.send(feedback(event))
        end.output.write_media(picture(event), lambda event=event: frame(encode_message(picture(event))))  # type: ignore[misc]
    end.hear(Ping(id=1), Ping(id=2))
    assert end.tcp.written() == []
    end.resume_writing()
    assert end.tcp.written() == [feedback(5), Pong(id=2), picture(5)]
    assert end.output.drops == {"feedback": 4, "pong": 1, "a": 4}


def test_a_peer_that_takes_nothing_for_a_second_is_dropped() -> None:
    end = opened()
    end.tcp.buffered = 100_000
    end.pause_writing()
    end.pass_time(0.5)
    end.hear(Ping(id=1))
    end.pass_time(0.45)
    assert end.tcp.aborts == 0
    end.pass_time(0.1)
    assert end.tcp.aborts > 0
    assert end.session.ended is not None
    assert "did not read" in end.session.ended.detail


def test_a_peer_that_takes_a_little_now_and_then_stays() -> None:
    end = opened()
    end.tcp.buffered = 100_000
    end.pause_writing()
    for _ in range(10):
        end.tcp.buffered -= 1000
        end.hear(Ping(id=1))
        end.pass_time(0.5)
    assert end.tcp.aborts == 0


def test_the_goodbye_is_the_last_message_and_the_link_is_lost_once() -> None:
    end = opened()
    end.end("closing", "bye")
    end.send(feedback(1))
    end.output.write_media(picture(1), lambda: b"")
    end.end("again")
    assert end.tcp.written() == [Goodbye(error="closing", detail="bye")]
    assert end.tcp.closed
    end.connection_lost(None)
    assert end.times_lost == 1


def test_a_close_that_hangs_is_aborted_after_a_second() -> None:
    end = opened()
    end.end("closing")
    end.pass_time(0.9)
    assert end.tcp.aborts == 0
    end.pass_time(0.2)
    assert end.tcp.aborts > 0


def test_after_the_connection_is_gone_nothing_is_sent_and_nothing_raises() -> None:
    end = opened()
    end.connection_lost(ConnectionResetError("reset"))
    end.send(feedback(1))
    end.tick()
    end.abort()
    end.pause_writing()
    end.resume_writing()
    assert end.tcp.written() == []
    assert end.session.ended == Goodbye(error="lost", detail="reset")


async def test_what_comes_faster_than_the_budget_allows_is_read_later_in_order_and_nothing_is_lost() -> None:
    end = Endpoint(MessageRate(1000.0, 20.0, 0.0))
    end.hear(Hello(role="operator"), *(Stop(by=str(number)) for number in range(100)))
    read = [len(end.events)]
    paused = end.tcp.reads is False
    while end.tcp.reads is False:
        end.now += 0.002
        await asyncio.sleep(0)  # until the loop reads on
        if len(end.events) != read[-1]:
            read.append(len(end.events))
    assert paused, "the sender finds the socket full"
    assert read[0] == 20
    assert max(after - before for before, after in zip(read, read[1:], strict=False)) <= 20
    assert [event.by for event in end.events if isinstance(event, Stop)] == [str(number) for number in range(100)]
    end.hear(Ping(id=1))
    assert Pong(id=1) in end.tcp.written()


async def test_a_connection_that_is_lost_while_it_waits_is_not_read_on() -> None:
    end = Endpoint(MessageRate(1000.0, 20.0, 0.0))
    end.hear(Hello(role="operator"), *(Stop() for _ in range(100)))
    count = len(end.events)
    end.connection_lost(None)
    end.now += 10.0
    await asyncio.sleep(0.05)
    assert len(end.events) == count
    assert end.times_lost == 1


def test_a_picture_that_waits_is_encoded_when_the_socket_takes_it() -> None:
    end = opened()
    made: list[int] = []

    def make() -> bytes:
        made.append(1)
        return frame(encode_message(picture(1)))

    end.pause_writing()
    end.output.write_media(picture(1), make)
    assert made == []
    end.resume_writing()
    assert made == [1]
