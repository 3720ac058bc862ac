"""The asyncio transport of both ends of the robot link: one session on one TCP connection, with bounded output."""

import asyncio
import socket
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import cast

from lockstep.protocol.framing import frame
from lockstep.protocol.messages import LinkMessage, Media, encode_message
from lockstep.robot_bridge.link.link_session import BadInput, LinkSession, kind_of
from lockstep.robot_bridge.link.message_rate import MessageRate
from lockstep.robot_bridge.link.outgoing_queues import MediaOutbox, NewestOutbox
from lockstep.robot_bridge.link.path_queue import path_queue

__all__ = ["TICK_INTERVAL", "LinkTransport"]

TICK_INTERVAL = 0.05  # s between calls of `LinkTransport.tick`
HIGH_WATER = 64 << 10  # bytes the kernel would not take before output waits in the outboxes
LITTLE = 4 << 10  # the same for a link with encoded pictures; at 512 kbit/s that is a sixteenth of a second
CLEAR = 0.06  # s of a longer round trip that are no queue: the other side's kernel may answer 0.04 s later
CLOSE_TIMEOUT = 1.0  # s for the goodbye to leave


class LinkTransport(asyncio.Protocol):
    """Feeds the session, sends its messages, and drops a peer that does not read.

    While the socket is full, messages wait in outboxes: one per kind, media per stream, newest wins. At most
    `HIGH_WATER` bytes and one further message are buffered. Messages beyond `rate` wait in the socket, so the sender
    finds the socket full; no message is lost.
    """

    def __init__(
        self, session: LinkSession, clock: Callable[[], float] = time.monotonic, rate: MessageRate | None = None
    ) -> None:
        """`rate`: None reads everything that comes."""
        self.session = session
        self._clock = clock
        self._message_rate = rate
        self._reading_on: asyncio.TimerHandle | None = None  # None: reading is not paused
        self._transport: asyncio.Transport | None = None  # None before and after the connection
        self._control: NewestOutbox[str, bytes] = NewestOutbox()
        self._media: MediaOutbox[Callable[[], bytes]] = MediaOutbox()
        self._full = False  # the socket takes no more for now
        self._buffered = 0  # bytes at the last look, to see whether the other side takes any
        self._moved = 0.0  # s, when the other side last took some
        self._closing_since: float | None = None
        self._lost = False

    @property
    def drops(self) -> Counter[str]:
        """The messages that were replaced by something newer, by message kind or stream."""
        return self._control.drops + self._media.drops

    def received(self, event: LinkMessage | BadInput) -> None:
        """Handle one event of the session; for the subclass."""

    def lost(self) -> None:
        """Handle the end of the session; called exactly once, for the subclass."""

    def send(self, message: LinkMessage) -> None:
        """Send, or keep the newest of its kind until there is room. Ignored after the end."""
        self.send_encoded(kind_of(message), partial(_encode, message))

    def send_encoded(self, kind: str, make: Callable[[], bytes]) -> None:
        """Send as `send` does, with a frame that several peers share."""
        if self.session.ended is None:
            self._write(kind, make)

    @property
    def has_room(self) -> bool:
        """True if the socket takes a message at once."""
        return self._transport is not None and self.session.ended is None and not self._full

    @property
    def path_is_clear(self) -> bool:
        """True if the socket takes a message at once and nothing waits before it, as far as the kernel knows."""
        if not self.has_room or self._transport is None:
            return False
        tcp = self._transport.get_extra_info("socket")
        queue = None if tcp is None else path_queue(tcp)
        return queue is None or (queue.unsent == 0 and queue.seconds < CLEAR)

    def send_media(self, media: Media, make: Callable[[], bytes]) -> bool:
        """Send as `send_encoded` does, newest wins per stream. False: pictures were dropped; a keyframe is needed.

        `make` is called when the socket takes the message.
        """
        if self._transport is None or self.session.ended is not None:
            return True
        if self._full:
            return self._media.put(media, lambda: make)
        self._transport.write(make())
        return True

    def keep_little(self) -> None:
        """Let hardly anything wait in this machine: what the network does not take now is to be left out instead."""
        if self._transport is None:
            return
        self._transport.set_write_buffer_limits(high=LITTLE, low=0)
        tcp = self._transport.get_extra_info("socket")
        if tcp is not None and hasattr(socket, "TCP_NOTSENT_LOWAT"):
            tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, LITTLE)

    def fileno(self) -> int:
        """Return the socket's descriptor; -1 without a socket."""
        tcp = None if self._transport is None else self._transport.get_extra_info("socket")
        return -1 if tcp is None else cast(int, tcp.fileno())

    def tick(self) -> None:
        """Send heartbeats; end silent sessions, peers that do not read, and closes that hang."""
        now = self._clock()
        self.session.tick(now)
        self._flush_session(now)
        if self._transport is None:
            return
        if self._closing_since is not None:
            if now - self._closing_since > CLOSE_TIMEOUT:
                self._transport.abort()
            return
        buffered = self._transport.get_write_buffer_size()
        if not self._full or buffered < self._buffered:
            self._moved = now
        self._buffered = buffered
        if now - self._moved > self.session.patience:
            self.session.lose(f"the other side did not read for {self.session.patience:.1f} s")
            self._transport.abort()

    def end(self, error: str, detail: str = "") -> None:
        """Say goodbye and close."""
        self.session.end(error, detail)
        self._flush_session(self._clock())

    def abort(self) -> None:
        """Close without waiting for the other side."""
        if self._transport is not None:
            self._transport.abort()

    # asyncio.Protocol

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._transport.set_write_buffer_limits(high=HIGH_WATER, low=0)
        tcp = transport.get_extra_info("socket")
        if tcp is not None:
            tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        now = self._moved = self._clock()
        self._flush_session(now)

    def data_received(self, data: bytes) -> None:
        now = self._clock()
        if self._message_rate is not None:
            self._message_rate.refill(now)
        events = self.session.receive(data, now, self._message_rate)
        if self.session.ended is None:
            self._send_outgoing()  # this side's hello leaves before any answer to messages behind the peer's
        for event in events:
            self.received(event)
        self._flush_session(now)
        if self._message_rate is not None and self.session.waits:
            self._pause_reading(self._message_rate.wait())

    def _pause_reading(self, seconds: float) -> None:
        if self._transport is not None and self._reading_on is None:
            self._transport.pause_reading()
            self._reading_on = asyncio.get_running_loop().call_later(seconds, self._read_on)

    def _read_on(self) -> None:
        self._reading_on = None
        self.data_received(b"")
        if self._reading_on is None and self._transport is not None and not self._transport.is_closing():
            self._transport.resume_reading()

    def pause_writing(self) -> None:
        self._full = True
        self._moved = self._clock()
        self._buffered = self._transport.get_write_buffer_size() if self._transport is not None else 0

    def resume_writing(self) -> None:
        self._full = False
        while not self._full and self._transport is not None and self._closing_since is None:
            data = self._control.pop()
            if data is None:
                make = self._media.pop()
                if make is None:
                    break
                data = make()
            self._transport.write(data)

    def connection_lost(self, error: Exception | None) -> None:
        self._transport = None
        if self._reading_on is not None:
            self._reading_on.cancel()
        self.session.lose(str(error) if error is not None else "the connection was closed")
        self._report_lost()

    def _flush_session(self, now: float) -> None:
        self._send_outgoing()
        if self.session.ended is not None and self._transport is not None and self._closing_since is None:
            self._closing_since = now
            self._leave(self._transport)
            self._report_lost()

    def _leave(self, transport: asyncio.Transport) -> None:
        """Close when what was written has left."""
        transport.close()

    def _send_outgoing(self) -> None:
        for message in self.session.take_outgoing():
            self._write(kind_of(message), partial(_encode, message))

    def _write(self, kind: str, make: Callable[[], bytes]) -> None:
        if self._transport is None or self._closing_since is not None:
            return
        if self._full:
            self._control.put(kind, make())
        else:
            self._transport.write(make())

    def _report_lost(self) -> None:
        if self._lost:
            return
        self._lost = True
        self.lost()


def _encode(message: LinkMessage) -> bytes:
    return frame(encode_message(message))
