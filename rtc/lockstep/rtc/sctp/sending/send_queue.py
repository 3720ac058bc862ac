"""The messages that have not been sent yet, and the order of their turns."""

from collections import deque
from typing import TYPE_CHECKING

from lockstep.rtc.sctp.errors import SendQueueFull
from lockstep.rtc.sctp.settings import SctpSettings

if TYPE_CHECKING:
    from lockstep.rtc.sctp.sending.outgoing import Outgoing

__all__ = ["Message", "SendQueue"]


class Message:
    """A message on its way out. It may be given up after `max_retransmits` repeats or at the time `expires`."""

    __slots__ = (
        "abandoned",
        "chunks",
        "expires",
        "max_retransmits",
        "newest_wins",
        "ordered",
        "payload",
        "protocol",
        "sequence",
        "stream",
        "taken",
    )

    def __init__(
        self,
        stream: int,
        protocol: int,
        payload: bytes,
        ordered: bool = True,
        max_retransmits: int | None = None,
        expires: float | None = None,
    ) -> None:
        self.stream = stream
        self.protocol = protocol  # PPID
        self.payload = payload
        self.ordered = ordered
        self.max_retransmits = max_retransmits
        self.expires = expires
        self.newest_wins = not ordered and max_retransmits == 0  # neither repeated nor put in order
        self.sequence = 0  # on its stream; given when its first fragment leaves
        self.taken = 0  # bytes that are in chunks already
        self.abandoned = False
        self.chunks: list[Outgoing] | None = None  # of a message of several


class SendQueue:
    """Holds newest-wins messages apart; all others by stream, and the streams take turns (RFC 8831 6.4 without
    priorities).

    `dropped` counts newest-wins messages that made room for newer ones, `expired` messages whose time had passed
    before they could leave.
    """

    def __init__(self, settings: SctpSettings) -> None:
        self._limit = settings.send_queue
        self._newest_limit = settings.newest_wins_queue
        self._newest_size = 0
        self._streams: dict[int, deque[Message]] = {}
        self._sizes: dict[int, int] = {}
        self.turns: deque[int] = deque()  # streams that have something
        self.newest: deque[Message] = deque()
        self.dropped = 0
        self.expired = 0

    def __len__(self) -> int:
        return len(self.newest) + sum(map(len, self._streams.values()))

    def put(self, message: Message) -> None:
        """Add a message.

        Raises:
            SendQueueFull: too much waits on this stream; the message was not taken.
        """
        size = len(message.payload)
        if message.newest_wins:
            self.newest.append(message)
            self._newest_size += size
            while self._newest_size > self._newest_limit and len(self.newest) > 1:
                self.take_newest()
                self.dropped += 1
            return
        waiting = self._sizes.get(message.stream, 0)
        if waiting and waiting + size > self._limit:
            raise SendQueueFull(f"{waiting} bytes wait on stream {message.stream}")
        self._sizes[message.stream] = waiting + size
        queue = self._streams.get(message.stream)
        if queue is None:
            queue = self._streams[message.stream] = deque()
            self.turns.append(message.stream)
        queue.append(message)

    def take_newest(self) -> Message:
        message = self.newest.popleft()
        self._newest_size -= len(message.payload)
        return message

    def head(self, now: float) -> Message | None:
        """Return the message of the stream whose turn it is; drop expired ones that were never begun."""
        while self.turns:
            message = self._streams[self.turns[0]][0]
            late = message.expires is not None and now > message.expires and not message.taken
            if not late and not message.abandoned:
                return message
            self.expired += late
            self.took(message, len(message.payload) - message.taken)
        return None

    def took(self, message: Message, size: int) -> None:
        """Note that `size` more bytes of the head are in chunks. The next stream has its turn."""
        message.taken += size
        stream = message.stream
        self.turns.rotate(-1)
        self._sizes[stream] -= size
        if message.taken < len(message.payload):
            return
        queue = self._streams[stream]
        queue.popleft()
        if not queue:
            del self._streams[stream], self._sizes[stream]
            self.turns.remove(stream)

    def buffered(self, stream: int) -> int:
        """Return the number of bytes that wait on this stream; newest-wins messages do not count."""
        return self._sizes.get(stream, 0)

    def has(self, stream: int) -> bool:
        """True if anything waits on this stream, newest-wins messages included."""
        if stream in self._streams:
            return True
        return bool(self.newest) and any(message.stream == stream for message in self.newest)

    def clear(self) -> None:
        self.newest.clear()
        self._streams.clear()
        self._sizes.clear()
        self.turns.clear()
        self._newest_size = 0
