"""Writes to one data channel without ever filling it: what the channel does not take at once waits in an outbox."""

from collections.abc import Callable

from aiortc import RTCDataChannel

from server.outbox import ChannelOutbox

__all__ = ["ChannelWriter"]


class ChannelWriter:
    """Bytes are handed to the channel only while it has nothing buffered, so feedback is never queued behind feedback.

    Attributes:
        too_large: messages that the remote's max-message-size (RFC 8841 6) forbids
    """

    def __init__(self, channel: RTCDataChannel, on_failed: Callable[[Exception], None] | None = None) -> None:
        """`on_failed` hears what the channel raised while nobody here called it; without, aiortc hears it."""
        self._channel = channel
        self._on_failed = on_failed
        self.outbox = ChannelOutbox()
        self.too_large = 0
        channel.on("bufferedamountlow", self._try_flush)

    @property
    def lost(self) -> int:
        """Messages that did not fit."""
        return self.outbox.dropped + self.too_large

    def send(self, text: str) -> None:
        self.outbox.put(text)
        self._flush()

    def send_newest(self, text: str) -> None:
        self.outbox.put_newest(text)
        self._flush()

    def _try_flush(self) -> None:
        try:
            self._flush()
        except Exception as error:
            if self._on_failed is None:
                raise
            self._on_failed(error)

    def _flush(self) -> None:
        while self._channel.readyState == "open" and self._channel.bufferedAmount == 0:
            text = self.outbox.take()
            if text is None:
                return
            try:
                self._channel.send(text)
            except ValueError:
                self.too_large += 1
