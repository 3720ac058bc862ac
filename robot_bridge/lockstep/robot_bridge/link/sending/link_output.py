"""The sending half of a link's TCP connection: what the socket does not take waits, bounded."""

import asyncio
import socket
from collections import Counter
from collections.abc import Callable
from typing import cast

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.link.sending.outgoing_queues import MediaOutbox, NewestOutbox
from lockstep.robot_bridge.link.sending.path_queue import path_queue

__all__ = ["CLEAR", "LinkOutput"]

HIGH_WATER = 64 << 10  # bytes the kernel would not take before output waits in the outboxes
LITTLE = 4 << 10  # the same for a link with encoded pictures; at 512 kbit/s that is a sixteenth of a second
CLEAR = 0.06  # s of a longer round trip that are no queue: the other side's kernel may answer 0.04 s later
CLOSE_TIMEOUT = 1.0  # s for the goodbye to leave


class LinkOutput:
    """Writes frames to the socket. While it is full they wait in outboxes: one per kind, media per stream, newest wins.

    At most `HIGH_WATER` bytes and one further message are buffered. Before `begin`, after `leave` and after `lost`
    nothing is written.

    Attributes:
        waits_for_end: `leave` ends this side alone, and goes on reading until the other side closes
    """

    def __init__(self) -> None:
        self.waits_for_end = False
        self._transport: asyncio.Transport | None = None  # None before and after the connection
        self._control: NewestOutbox[str, bytes] = NewestOutbox()
        self._media: MediaOutbox[Callable[[], bytes]] = MediaOutbox()
        self._full = False  # the socket takes no more for now
        self._buffered = 0  # bytes at the last look, to see whether the other side takes any
        self._moved = 0.0  # s, when the other side last took some
        self._left_at: float | None = None  # s, when this side left, or the connection was lost

    @property
    def drops(self) -> Counter[str]:
        """The messages that were replaced by something newer, by message kind or stream."""
        return self._control.drops + self._media.drops

    @property
    def has_room(self) -> bool:
        """True if the socket takes a message at once."""
        return self._transport is not None and self._left_at is None and not self._full

    @property
    def path_is_clear(self) -> bool:
        """True if the socket takes a message at once and nothing waits before it, as far as the kernel knows."""
        if not self.has_room or self._transport is None:
            return False
        tcp = self._transport.get_extra_info("socket")
        queue = None if tcp is None else path_queue(tcp)
        return queue is None or (queue.unsent == 0 and queue.seconds < CLEAR)

    def begin(self, transport: asyncio.Transport, now: float) -> None:
        """Begin to write to a connection."""
        self._transport = transport
        self._moved = now
        transport.set_write_buffer_limits(high=HIGH_WATER, low=0)
        tcp = transport.get_extra_info("socket")
        if tcp is not None:
            tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

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

    def write(self, kind: str, make: Callable[[], bytes]) -> None:
        """Write a frame, or keep the newest of its kind until there is room."""
        if self._transport is None or self._left_at is not None:
            return
        if self._full:
            self._control.put(kind, make())
        else:
            self._transport.write(make())

    def write_media(self, media: Media, make: Callable[[], bytes]) -> bool:
        """Write as `write` does, newest wins per stream. False: pictures were dropped; a keyframe is needed.

        `make` is called when the socket takes the message.
        """
        if self._transport is None or self._left_at is not None:
            return True
        if self._full:
            return self._media.put(media, lambda: make)
        self._transport.write(make())
        return True

    def pause(self, now: float) -> None:
        """Keep what comes: the socket is full."""
        self._full = True
        self._moved = now
        self._buffered = self._transport.get_write_buffer_size() if self._transport is not None else 0

    def resume(self) -> None:
        """Write what waits: the socket has room."""
        self._full = False
        while not self._full and self._transport is not None and self._left_at is None:
            data = self._control.pop()
            if data is None:
                make = self._media.pop()
                if make is None:
                    break
                data = make()
            self._transport.write(data)

    def hangs(self, now: float, patience: float) -> bool:
        """Return whether the other side has read nothing for `patience` s, or a close takes too long.

        Call it at intervals.
        """
        if self._transport is None:
            return False
        if self._left_at is not None:
            return now - self._left_at > CLOSE_TIMEOUT
        buffered = self._transport.get_write_buffer_size()
        if not self._full or buffered < self._buffered:
            self._moved = now
        self._buffered = buffered
        return now - self._moved > patience

    def leave(self, now: float) -> bool:
        """Close when what was written has left. False before the connection: there is nothing to close yet."""
        if self._left_at is None and self._transport is not None:
            self._left_at = now
            self._end(self._transport)
        return self._left_at is not None

    def _end(self, transport: asyncio.Transport) -> None:
        if self.waits_for_end:
            try:
                transport.write_eof()
            except OSError:  # the other side has reset the connection: nothing that was sent can still arrive
                transport.close()
            else:
                transport.resume_reading()
        else:
            transport.close()

    def lost(self, now: float) -> None:
        """Note that the connection is gone, or was never made."""
        self._transport = None
        if self._left_at is None:
            self._left_at = now
