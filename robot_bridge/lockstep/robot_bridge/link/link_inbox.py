"""Messages that came on a link, for its reader: they wait, bounded, or are handed over as they come."""

import asyncio
from collections import Counter
from collections.abc import Callable

from lockstep.protocol.messages import LinkMessage, Media
from lockstep.robot_bridge.link.link_session import kind_of
from lockstep.robot_bridge.link.sending.outgoing_queues import MediaOutbox

__all__ = ["MAX_INBOX", "LinkInbox"]

MAX_INBOX = 256  # messages besides media that may wait for the reader


class LinkInbox:
    """Of the messages that wait the oldest are dropped, of media all but the newest pictures of each stream.

    Attributes:
        drops: by message kind, {"feedback": 2}; media are in `media_drops`
        failure: the exception that the receiver of `hand_over` raised; None while it has raised none
    """

    def __init__(self) -> None:
        self.drops: Counter[str] = Counter()
        self.failure: Exception | None = None
        self._messages: dict[int, LinkMessage] = {}  # by arrival, oldest first
        self._arrivals = 0
        self._media: MediaOutbox[Media] = MediaOutbox()
        self._take: Callable[[LinkMessage], None] | None = None  # None: messages wait
        self._news = asyncio.Event()

    @property
    def media_drops(self) -> Counter[str]:
        """The dropped media by stream."""
        return self._media.drops

    def put(self, message: LinkMessage) -> None:
        """Take a message that came."""
        if self._take is not None:
            self._give(self._take, message)
            return
        if isinstance(message, Media):
            self._media.put(message, lambda: message)
        else:
            self._arrivals += 1
            self._messages[self._arrivals] = message
            if len(self._messages) > MAX_INBOX:
                dropped = self._messages.pop(next(iter(self._messages)))
                self.drops[kind_of(dropped)] += 1
        self._news.set()

    def pop(self) -> LinkMessage | None:
        """Remove and return the oldest waiting message, media last; None if no message waits."""
        return self._messages.pop(next(iter(self._messages))) if self._messages else self._media.pop()

    def hand_over(self, take: Callable[[LinkMessage], None]) -> None:
        """Hand what waits to `take`, and from now on each message as it comes, until `keep` or until `take` raises."""
        self._take = take
        while self._take is not None and (waits := self.pop()) is not None:
            self._give(take, waits)

    def keep(self) -> None:
        """Let messages wait again."""
        self._take = None

    def wake(self) -> None:
        """Let `changed` return: the link has changed."""
        self._news.set()

    async def changed(self) -> None:
        """Wait until a message comes to wait, the receiver fails, or `wake` is called."""
        self._news.clear()
        await self._news.wait()

    def _give(self, take: Callable[[LinkMessage], None], message: LinkMessage) -> None:
        try:
            take(message)
        except Exception as error:
            self.failure = error
            self._take = None
            self._news.set()
