"""Notes to everyone: cleaned, numbered, limited in rate. No I/O, no clock.

Newcomers get the last notes of this session, which ends when nobody has been there for SESSION_GAP. Notes of earlier
sessions are in the audit and the recordings, for those who may read them.
"""

from collections import deque
from collections.abc import Iterator

from lockstep.protocol.console import Role, SharedNote
from lockstep.protocol.messages import RefusalReason
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.util.display_names import printable
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["NoteBoard"]

KEPT = 100
BURST = 5  # notes of one link at once, however many connections it has
LINK_RATE = 0.5  # notes a second of one link
BOARD_BURST = 20.0  # of all peers together: every note goes to everyone
BOARD_RATE = 4.0
SESSION_GAP = 600.0  # s; the notes outlast a reload of the page and a lost connection


class NoteBoard:
    """The last notes of a session. `now` is monotonic seconds, `clock` seconds since 1970."""

    def __init__(self) -> None:
        self._kept: deque[SharedNote] = deque(maxlen=KEPT)
        self._next_id = 1
        self._all = TokenBucket(BOARD_RATE, BOARD_BURST)
        self._links = RateLimits(LINK_RATE, BURST)
        self._empty_since: float | None = None

    def left_empty(self, now: float) -> None:
        """Called when the last participant has left."""
        self._empty_since = now

    def joined(self, now: float) -> None:
        """Called when somebody joins. Drops notes from before a gap without anybody: they are not for newcomers."""
        if self._empty_since is not None and now - self._empty_since >= SESSION_GAP:
            self._kept.clear()
        self._empty_since = None

    def __iter__(self) -> Iterator[SharedNote]:
        """Iterate over the last notes, oldest first."""
        return iter(list(self._kept))

    def write(
        self, link: str, peer: str, name: str, role: Role, text: str, epoch: str, event: int, now: float, clock: float
    ) -> SharedNote | RefusalReason:
        """Keep a note, or refuse it: this link or all together write too often, or nothing in it can be printed."""
        text = printable(text)
        if not text:
            return "malformed"
        if not (self._all.has(now) and self._links.spend(link, now)):
            return "too_often"
        self._all.take(now)
        return self._keep(peer, name, role, text, epoch, event, round(clock, 3))

    def _keep(self, peer: str, name: str, role: Role, text: str, epoch: str, event: int, clock: float) -> SharedNote:
        note = SharedNote(
            id=self._next_id, peer=peer, name=name, role=role, text=text, epoch=epoch, event=event, time=clock
        )
        self._next_id += 1
        self._kept.append(note)
        return note
