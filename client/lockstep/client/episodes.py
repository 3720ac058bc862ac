"""Episodes of the console's recording: begin, keep, discard (docs/episodes.md)."""

import asyncio
import secrets
from collections import OrderedDict
from collections.abc import Awaitable, Callable

from lockstep.client.errors import ConsoleLost, EpisodeRefused
from lockstep.client.transport.transport import Transport
from lockstep.protocol.episodes import EpisodeAnswer, EpisodeOutcome, EpisodeRequest, EpisodeState

__all__ = ["EpisodeNews", "Episodes"]

KEPT_ANSWERS = 64
ANSWER_SECONDS = 5.0  # for the console to answer
DISK_SECONDS = 30.0  # for an episode to be on the disk


class EpisodeNews:
    """The console's messages about episodes. No I/O.

    Attributes:
        state: the newest; None before the first
    """

    def __init__(self) -> None:
        self.state: EpisodeState | None = None
        self.answers: OrderedDict[str, EpisodeAnswer] = OrderedDict()  # by id of the request

    def hear(self, message: EpisodeState | EpisodeAnswer) -> None:
        if isinstance(message, EpisodeState):
            self.state = message
            return
        self.answers[message.id] = message
        if len(self.answers) > KEPT_ANSWERS:
            self.answers.popitem(last=False)


class Episodes:
    """The episodes of a connection: `console.episodes`. The holder of the seat and supervisors may ask.

    All methods raise EpisodeRefused with the reason's name, and ConsoleLost when the console does not answer.
    """

    def __init__(
        self,
        transport: Transport,
        news: EpisodeNews,
        until: Callable[[Callable[[], bool]], Awaitable[None]],
    ) -> None:
        """`until`: waits until a message makes a condition true."""
        self._transport = transport
        self._news = news
        self._until = until

    @property
    def state(self) -> EpisodeState:
        """The newest state that the console has sent."""
        return self._news.state or EpisodeState()

    async def start(self, task: str = "") -> str:
        """Begin an episode; return its id when it has begun, after the reset and the count-down.

        Args:
            task: what is to be done, in words; "": as the last one
        """
        before = self.state.episode
        await self._ask(EpisodeRequest(id=_fresh(), do="start", task=task), ANSWER_SECONDS)
        return await self._begun(before)

    async def keep(self, outcome: EpisodeOutcome = "", episode: str = "") -> None:
        """End the open episode and keep it; return when it is on the disk.

        Args:
            outcome: "success", "failure" or, if nobody has said, ""
            episode: its id; "": whichever is open
        """
        await self._ask(EpisodeRequest(id=_fresh(), do="keep", outcome=outcome, episode=episode), DISK_SECONDS)

    async def success(self) -> None:
        """Keep the open episode as a success."""
        await self.keep("success")

    async def failure(self) -> None:
        """Keep the open episode as a failure."""
        await self.keep("failure")

    async def discard(self, episode: str = "") -> None:
        """End the open episode; it is in no dataset. Before its begin: cancel it."""
        await self._ask(EpisodeRequest(id=_fresh(), do="discard", episode=episode), ANSWER_SECONDS)

    async def redo(self, episode: str = "") -> str:
        """Discard the open episode and begin the next one with the same task; return its id when it has begun."""
        before = self.state.episode
        await self._ask(EpisodeRequest(id=_fresh(), do="redo", episode=episode), ANSWER_SECONDS)
        return await self._begun(before)

    async def mark(self, text: str = "") -> None:
        """Set a mark at the present event of the open episode."""
        await self._ask(EpisodeRequest(id=_fresh(), do="mark", text=text), ANSWER_SECONDS)

    async def _ask(self, request: EpisodeRequest, seconds: float) -> EpisodeAnswer:
        self._transport.send("session", request)
        try:
            async with asyncio.timeout(seconds):
                await self._until(lambda: request.id in self._news.answers)
        except TimeoutError:
            raise ConsoleLost(f"no answer from the console within {seconds:g} s") from None
        answer = self._news.answers.pop(request.id)
        if answer.reason:
            raise EpisodeRefused(answer.reason, answer.detail)
        return answer

    async def _begun(self, before: str) -> str:
        """Wait until another episode than `before` is open, or until nothing is about to begin any more."""

        def decided() -> bool:
            state = self.state
            return state.phase == "idle" or (state.phase == "open" and state.episode != before)

        await self._until(decided)
        if self.state.phase != "open":
            raise EpisodeRefused("no_episode", self.state.last)
        return self.state.episode


def _fresh() -> str:
    return secrets.token_hex(8)
