from typing import cast

from lockstep.rtc.channels import ChannelNotOpen
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.sctp import MessageTooLarge
from lockstep.server.peers.channel_writer import ChannelWriter

CHANNEL = 4


class FakeConnection:
    """Has one data channel, which takes texts but delivers only when told."""

    def __init__(self) -> None:
        self.peer = self.channels = self.association = self
        self.is_open = True
        self.waiting = False
        self.told_when_empty = 0
        self.max_message = 100
        self.taken: list[str] = []

    def has_waiting(self, channel: int) -> bool:
        assert channel == CHANNEL
        return self.waiting

    def tell_when_empty(self, channel: int) -> None:
        assert channel == CHANNEL
        self.told_when_empty += 1

    def send(self, channel: int, text: str) -> None:
        assert channel == CHANNEL
        if not self.is_open:
            raise ChannelNotOpen(channel)
        if len(text) > self.max_message:
            raise MessageTooLarge(text)
        self.taken.append(text)
        self.waiting = True


def _writer() -> tuple[ChannelWriter, FakeConnection]:
    connection = FakeConnection()
    return ChannelWriter(cast(Connection, connection), CHANNEL), connection


def _drain(writer: ChannelWriter, connection: FakeConnection) -> None:
    connection.waiting = False
    writer.flush()


def test_an_idle_channel_is_written_to_at_once_and_nobody_has_to_say_when_it_is_empty() -> None:
    writer, connection = _writer()
    writer.send("hello")
    assert connection.taken == ["hello"]
    assert connection.told_when_empty == 0


def test_while_a_message_waits_only_the_newest_feedback_is_kept() -> None:
    writer, connection = _writer()
    for number in range(4):
        writer.send_newest(f"feedback {number}")
    writer.send("refusal")
    assert connection.taken == ["feedback 0"]
    assert connection.told_when_empty > 0
    _drain(writer, connection)
    _drain(writer, connection)
    assert connection.taken == ["feedback 0", "refusal", "feedback 3"]


def test_a_closed_channel_takes_nothing() -> None:
    writer, connection = _writer()
    connection.is_open = False
    writer.send("hello")
    assert connection.taken == []


def test_a_message_that_the_peer_cannot_take_is_left_out_and_counted() -> None:
    writer, connection = _writer()
    writer.send("x" * 101)
    writer.send("hello")
    assert connection.taken == ["hello"]
    assert writer.too_large == writer.lost == 1


def test_what_can_be_spared_is_left_out_while_anything_waits() -> None:
    writer, connection = _writer()
    writer.send_spare("one")
    writer.send_spare("two")
    assert connection.taken == ["one"]
    connection.waiting = False
    writer.send_spare("three")
    assert connection.taken == ["one", "three"]
    writer.send_newest("feedback")
    writer.send_spare("four")
    _drain(writer, connection)
    assert connection.taken == ["one", "three", "feedback"]
