"""The session in one relay, and what `SfuCoordinator` needs of the engine that brings it there."""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import Protocol

import structlog

from lockstep.protocol.console import StreamInfo
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.tickets import RelayTicket

__all__ = ["Engine", "Publication", "Watched"]

log = structlog.get_logger(__name__)


class Watched(Protocol):
    """Something that ends by itself one day."""

    @property
    def ended(self) -> asyncio.Event: ...
    @property
    def why(self) -> str: ...


class Publication:
    """What a relay carries. It ends once."""

    def __init__(self, feed: int, streams: list[StreamInfo], send: Callable[[str], None]) -> None:
        """`send` takes feedback; the newest wins."""
        self.feed = feed
        self.streams = streams
        self.ended = asyncio.Event()
        self.why = ""
        self._send = send

    def send_feedback(self, text: str) -> None:
        """Raises nothing: relays are served among the observers."""
        try:
            self._send(text)
        except Exception as error:
            self.failed("feedback", error)

    def failed(self, stage: str, error: Exception) -> None:
        """Serving this relay raised `error`: the publication ends, and may begin anew. Raises nothing."""
        log.error("a relay could not be served", stage=stage, exc_info=error)
        self.end(f"internal error: {stage}")

    def end(self, why: str) -> None:
        """The first reason counts."""
        if not self.ended.is_set():
            self.why = why
            self.ended.set()


class Engine(Protocol):
    """A relay's client. What it raises is RelayError, MediaError or OSError."""

    def publish(self, station: SfuServer, feed: int) -> AbstractAsyncContextManager[Publication]:
        """The session is in that relay while entered. Nobody who was told of an earlier feed gets in with that."""

    def pass_on(
        self, origin: SfuServer, station: SfuServer, publication: Publication
    ) -> AbstractAsyncContextManager[Watched]:
        """While entered, the first relay feeds another one."""

    def ticket(self, station: SfuServer) -> RelayTicket:
        """For one observer, of a station that carries the session."""
