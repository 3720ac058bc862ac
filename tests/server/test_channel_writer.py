from collections.abc import Callable
from typing import cast

from aiortc import RTCDataChannel

from server.channel_writer import ChannelWriter


class FakeChannel:
    """A data channel that takes texts but delivers only when told."""

    def __init__(self) -> None:
        self.readyState = "open"
        self.bufferedAmount = 0
        self.max_message_size = 100
        self.taken: list[str] = []
        self._on_low: Callable[[], None] = lambda: None

    def on(self, name: str, handler: Callable[[], None]) -> None:
        assert name == "bufferedamountlow"
        self._on_low = handler

    def send(self, text: str) -> None:
        if len(text) > self.max_message_size:
            raise ValueError(text)
        self.taken.append(text)
        self.bufferedAmount += len(text)

    def drain(self) -> None:
        self.bufferedAmount = 0
        self._on_low()


def _writer() -> tuple[ChannelWriter, FakeChannel]:
    channel = FakeChannel()
    return ChannelWriter(cast(RTCDataChannel, channel)), channel


def test_an_idle_channel_is_written_to_at_once() -> None:
    writer, channel = _writer()
    writer.send("hello")
    assert channel.taken == ["hello"]


def test_while_bytes_are_buffered_only_the_newest_feedback_is_kept() -> None:
    writer, channel = _writer()
    for number in range(4):
        writer.send_newest(f"feedback {number}")
    writer.send("refusal")
    assert channel.taken == ["feedback 0"]
    channel.drain()
    channel.drain()
    assert channel.taken == ["feedback 0", "refusal", "feedback 3"]


def test_a_closed_channel_takes_nothing() -> None:
    writer, channel = _writer()
    channel.readyState = "closed"
    writer.send("hello")
    assert channel.taken == []


def test_a_text_that_the_remote_cannot_take_is_counted_and_does_not_hold_up_the_next() -> None:
    writer, channel = _writer()
    writer.send("x" * 101)
    writer.send("short")
    assert channel.taken == ["short"]
    assert writer.too_large == 1
