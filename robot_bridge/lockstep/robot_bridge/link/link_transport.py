"""The asyncio transport of both ends of the robot link: one session on one TCP connection, with bounded output."""

import asyncio
import time
from collections.abc import Callable
from functools import partial
from typing import cast

from lockstep.protocol.framing import frame
from lockstep.protocol.messages import LinkMessage, encode_message
from lockstep.robot_bridge.link.link_session import BadInput, LinkSession, kind_of
from lockstep.robot_bridge.link.message_rate import MessageRate
from lockstep.robot_bridge.link.sending.link_output import LinkOutput

__all__ = ["TICK_INTERVAL", "LinkTransport"]

TICK_INTERVAL = 0.05  # s between calls of `LinkTransport.tick`


class LinkTransport(asyncio.Protocol):
    """Feeds the session, sends its messages, and drops a peer that does not read.

    Messages beyond `rate` wait in the socket, so the sender finds the socket full; no message is lost.

    Attributes:
        output: what is written to the socket, and what waits for it
    """

    def __init__(
        self, session: LinkSession, clock: Callable[[], float] = time.monotonic, rate: MessageRate | None = None
    ) -> None:
        """`rate`: None reads everything that comes."""
        self.session = session
        self.output = LinkOutput()
        self._clock = clock
        self._message_rate = rate
        self._reading_on: asyncio.TimerHandle | None = None  # None: reading is not paused
        self._transport: asyncio.Transport | None = None  # None before and after the connection
        self._is_lost = False

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
            self.output.write(kind, make)

    def tick(self) -> None:
        """Send heartbeats; end silent sessions, peers that do not read, and closes that hang."""
        now = self._clock()
        self.session.tick(now)
        self._flush_session(now)
        patience = self.session.patience
        if self._transport is not None and self.output.hangs(now, patience):
            self.session.lose(f"the other side did not read for {patience:.1f} s")
            self.output.lost(now)
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
        now = self._clock()
        self.output.begin(self._transport, now)
        self._flush_session(now)

    def data_received(self, data: bytes) -> None:
        now = self._clock()
        if self._message_rate is not None:
            self._message_rate.refill(now)
        events = self.session.receive(data, now, self._message_rate)
        if self.session.ended is None:
            self._flush_session(now)  # this side's hello leaves before any answer to messages behind the peer's
        for event in events:
            self.received(event)
        self._flush_session(now)
        if self._message_rate is None or not self.session.waits:
            return
        if self._transport is not None and self._reading_on is None:
            self._transport.pause_reading()
            self._reading_on = asyncio.get_running_loop().call_later(self._message_rate.wait(), self._read_on)

    def _read_on(self) -> None:
        self._reading_on = None
        self.data_received(b"")
        if self._reading_on is None and self._transport is not None and not self._transport.is_closing():
            self._transport.resume_reading()

    def pause_writing(self) -> None:
        self.output.pause(self._clock())

    def resume_writing(self) -> None:
        self.output.resume()

    def connection_lost(self, error: Exception | None) -> None:
        now = self._clock()
        self._transport = None
        self.output.lost(now)
        if self._reading_on is not None:
            self._reading_on.cancel()
        self.session.lose(str(error) if error is not None else "the connection was closed")
        self._flush_session(now)

    def _flush_session(self, now: float) -> None:
        for message in self.session.take_outgoing():
            self.output.write(kind_of(message), partial(_encode, message))
        if self.session.ended is not None and not self._is_lost and self.output.leave(now):
            self._is_lost = True
            self.lost()


def _encode(message: LinkMessage) -> bytes:
    return frame(encode_message(message))
