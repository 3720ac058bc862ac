"""The session in one relay, and the engine by which `SfuCoordinator` publishes it."""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import Protocol

import structlog

from lockstep.protocol.console import StreamInfo
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.tickets import RelayTicket

__all__ = ["NEW_EPOCH", "Engine", "Publication", "Watched"]

log = structlog.get_logger(__name__)

NEW_EPOCH = "new epoch"  # the reason for the end of a publication whose streams have ended


class Watched(Protocol):
    """A connection that may end unasked: `ended` is set then, and `why` holds the reason."""

    @property
    def ended(self) -> asyncio.Event: ...
    @property
    def why(self) -> str: ...


class Publication:
    """The session as one relay carries it. It ends once."""

    def __init__(self, feed: int, streams: list[StreamInfo], send: Callable[[str], None]) -> None:
        """`send` takes feedback; the newest wins."""
        self.feed = feed
        self.streams = streams
        self.ended = asyncio.Event()
        self.why = ""
        self._send = send

    def send_feedback(self, text: str) -> None:
        """Send feedback. Raises nothing: relays are served among the observers."""
        try:
            self._send(text)
        except Exception as error:
            self.failed("feedback", error)

    def failed(self, stage: str, error: Exception) -> None:
        """End the publication, since serving this relay raised `error`; it may begin anew. Raises nothing."""
        log.error("a relay could not be served", stage=stage, exc_info=error)
        self.end(f"internal error: {stage}")

    def end(self, why: str) -> None:
        """End the publication. Only the first reason counts."""
        if not self.ended.is_set():
            self.why = why
            self.ended.set()


class Engine(Protocol):
    """A relay's client. It raises RelayError, MediaError or OSError."""

    def publish(self, station: SfuServer, feed: int) -> AbstractAsyncContextManager[Publication]:
        """Publish the session in that relay while entered. A ticket for an earlier feed opens nothing."""

    def pass_on(
        self, origin: SfuServer, station: SfuServer, publication: Publication
    ) -> AbstractAsyncContextManager[Watched]:
        """Feed `station` from `origin` while entered."""

    def ticket(self, station: SfuServer) -> RelayTicket:
        """Return a ticket for one observer to a relay that carries the session."""
