"""Writes to one data channel without ever filling it: messages that it does not take at once wait in a queue."""

from lockstep.rtc.channels import ChannelNotOpen
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer import PeerNotReady
from lockstep.rtc.sctp import AssociationClosed, MessageTooLarge
from lockstep.server.peers.channel_queue import ChannelQueue

__all__ = ["ChannelWriter"]

ENDED = (ChannelNotOpen, AssociationClosed, PeerNotReady)


class ChannelWriter:
    """Hands a message to the channel only while none waits there, so feedback is never queued behind feedback.

    Attributes:
        too_large: messages that the peer's max-message-size (RFC 8841 6) forbids
    """

    def __init__(self, connection: Connection, channel: int) -> None:
        """Call `flush` on `ChannelWritable`."""
        channels = connection.peer.channels
        assert channels is not None  # `channel` is one of them
        self._connection = connection
        self._channels = channels
        self._channel = channel
        self.queue = ChannelQueue()
        self.too_large = 0

    @property
    def lost(self) -> int:
        """Messages that did not fit."""
        return self.queue.dropped + self.too_large

    def send(self, text: str) -> None:
        self.queue.put(text)
        self.flush()

    def send_newest(self, text: str) -> None:
        self.queue.put_newest(text)
        self.flush()

    def send_spare(self, text: str) -> None:
        """Send unless something waits already: then nobody needs it."""
        if self.queue.empty and not self._channels.association.has_waiting(self._channel):
            self.send(text)

    def flush(self) -> None:
        """Hand on the messages in the queue, as far as the channel takes them at once."""
        while not self._channels.association.has_waiting(self._channel):
            text = self.queue.take()
            if text is None:
                return
            try:
                self._connection.send(self._channel, text)
            except MessageTooLarge:
                self.too_large += 1
            except ENDED:
                return  # the peer's end follows
        if not self.queue.empty:
            self._channels.tell_when_empty(self._channel)
