"""Notes to everyone."""

from lockstep.client.errors import CommandRefused
from lockstep.client.requests.exchange import Exchange
from lockstep.client.session import Session
from lockstep.protocol.console import Note, SharedNote

__all__ = ["Notes"]


class Notes:
    """Writes notes, which the console sends back to all participants."""

    def __init__(self, session: Session, exchange: Exchange) -> None:
        self._session = session
        self._exchange = exchange

    async def write(self, text: str) -> SharedNote:
        """Write a note and return it. Raises CommandRefused: too many notes, or nothing in this one can be printed."""
        newest = self._session.notes[-1].id if self._session.notes else 0

        def mine() -> SharedNote | None:
            return next(
                (note for note in self._session.notes if note.id > newest and note.peer == self._session.peer), None
            )

        refusal = await self._exchange.ask(lambda: mine() is not None, "session", Note(text=text))
        note = mine()
        if note is None:
            raise CommandRefused(*(("declined", "") if refusal is None else (refusal.reason, refusal.detail)))
        return note
