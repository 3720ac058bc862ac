"""The sending half of a link on a transport whose fullness the test decides."""

import asyncio

import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.link.sending.link_output import CLOSE_TIMEOUT, LinkOutput

PICTURE = Media(stream="a", codec="mjpeg", stamp=1, time=0.0, payload=b"")


class FakeTransport(asyncio.Transport):
    def __init__(self, *, is_reset: bool = False) -> None:
        super().__init__()
        self.written: list[bytes] = []
        self.calls: list[str] = []
        self.buffered = 0
        self._is_reset = is_reset

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        pass

    def get_write_buffer_size(self) -> int:
        return self.buffered

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.written.append(bytes(data))

    def write_eof(self) -> None:
        if self._is_reset:
            raise OSError(107, "Transport endpoint is not connected")
        self.calls.append("write_eof")

    def resume_reading(self) -> None:
        self.calls.append("resume_reading")

    def close(self) -> None:
        self.calls.append("close")


def begun(transport: FakeTransport) -> LinkOutput:
    output = LinkOutput()
    output.begin(transport, 0.0)
    return output


def test_before_the_connection_nothing_is_written_and_there_is_nothing_to_close() -> None:
    output = LinkOutput()
    output.write("pong", lambda: b"lost")
    assert output.write_media(PICTURE, lambda: b"lost")
    output.keep_little()
    assert not output.leave(0.0)
    assert not output.has_room
    assert not output.path_is_clear
    assert not output.hangs(100.0, 1.0)
    assert output.fileno() == -1
    output.begin(transport := FakeTransport(), 0.0)
    output.write("pong", lambda: b"first")
    assert transport.written == [b"first"]


def test_a_full_socket_keeps_messages_before_media_and_has_no_room() -> None:
    output = begun(transport := FakeTransport())
    assert (output.has_room, output.path_is_clear) == (True, True)
    output.pause(0.0)
    assert (output.has_room, output.path_is_clear) == (False, False)
    assert output.write_media(PICTURE, lambda: b"picture")
    output.write("pong", lambda: b"pong")
    assert transport.written == []
    output.resume()
    assert transport.written == [b"pong", b"picture"]
    assert (output.has_room, output.path_is_clear) == (True, True)


def test_only_a_full_socket_that_takes_nothing_hangs() -> None:
    output = begun(transport := FakeTransport())
    assert not output.hangs(5.0, 1.0)
    transport.buffered = 100
    output.pause(5.0)
    assert not output.hangs(5.9, 1.0)
    transport.buffered = 99
    assert not output.hangs(6.5, 1.0), "it took a byte"
    assert output.hangs(7.6, 1.0)


@pytest.mark.parametrize(
    ("waits", "is_reset", "calls"),
    [
        (False, False, ["close"]),
        (True, False, ["write_eof", "resume_reading"]),
        (True, True, ["close"]),
    ],
)
def test_leaving_ends_this_side_and_a_close_that_takes_too_long_hangs(
    waits: bool, is_reset: bool, calls: list[str]
) -> None:
    output = begun(transport := FakeTransport(is_reset=is_reset))
    output.waits_for_end = waits
    assert output.leave(1.0)
    assert output.leave(1.5)
    assert transport.calls == calls
    output.write("pong", lambda: b"late")
    assert transport.written == []
    assert not output.hangs(1.0 + CLOSE_TIMEOUT, 0.0)
    assert output.hangs(1.1 + CLOSE_TIMEOUT, 0.0)


def test_a_lost_connection_is_left() -> None:
    output = begun(transport := FakeTransport())
    output.lost(1.0)
    output.write("pong", lambda: b"late")
    assert output.leave(1.0)
    assert not output.hangs(100.0, 1.0)
    assert (transport.written, transport.calls) == ([], [])
