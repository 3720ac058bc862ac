"""Presses of STOP: those that the robot has not answered yet, and the outcomes of those that it has. No I/O.

A press is *pending* from when it is made until the bridge answers it (`StopTaken`). Neither the end of the link nor
another epoch of the bridge ends that: the owner of the link sends all pending presses, in order, whenever a link is
up, before anything else. The bridge knows a press by its id, so sending it again makes no second stop.

At most `MAX_PENDING` are kept. One more replaces the newest, which from then on has the outcome of its replacement:
that one was made later, so its stop is the newer one.

A link that presses faster than people do has its presses *held*: the first of them waits for `take_held`, and those
that the link makes meanwhile share its outcome. It is sent after all of them were made, so its stop is as new as any
of them. A held press is pending like any other.
"""

import hashlib
import json
import re
import secrets
import time
from collections import OrderedDict
from typing import NamedTuple

import msgspec

from lockstep.protocol.messages import Stop, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.util.display_names import printable

__all__ = [
    "MAX_GIVEN",
    "MAX_REASON",
    "AlreadyTaken",
    "Held",
    "NewPress",
    "Press",
    "PressOutcome",
    "Settled",
    "StopPresses",
    "UnderWay",
    "new_press",
    "press_id",
    "stop_text",
    "told_id",
]

PRESS_ID = re.compile(r"[0-9a-f]{32}")
MAX_GIVEN = 64  # characters of an id in a message
MAX_REASON = 500  # characters, as on the robot link
MAX_PENDING = 64
MAX_SAME = 256  # presses that share the outcome of another one; further ones get no answer
MAX_REMEMBERED = 512  # outcomes


class Press(msgspec.Struct, frozen=True, kw_only=True):
    """One press of STOP, with its author, channel and reason."""

    id: str  # "5f0c…", 32 lower-case hex digits
    by: Actor = Actor()
    where: str = ""  # "http", "board", a channel
    reason: str = ""
    time: float = 0.0  # s since 1970, the console's clock: for people, and for the order of presses of earlier runs

    def message(self) -> Stop:
        return Stop(by=self.by.name[:500], reason=self.reason[:500], press=self.id)


def new_press(by: Actor, where: str, reason: str, given: str = "") -> Press:
    """Make a press, timed now. `given`: the id that its sender has made; without it the press gets a new one.

    Everybody sees the reason, so only its printable characters are kept.
    """
    id_ = press_id(by.link, given) if given else secrets.token_hex(16)
    return Press(id=id_, by=by, where=where, reason=printable(reason)[:MAX_REASON], time=time.time())


def press_id(link: str, given: str) -> str:
    """Return the console's id for a press that its sender calls `given`.

    No stop is refused for its id. An id that is not 32 lower-case hex digits is replaced by one that is: the same for
    every repeat by this link, and another one for any other link, so that nobody's stop passes for somebody else's.
    """
    if PRESS_ID.fullmatch(given):
        return given
    text = f"{link}\n{given}".encode(errors="surrogatepass")
    return hashlib.sha256(text).hexdigest()[:32]


def stop_text(value: object) -> str:
    """Return a field of a stop as text. It may be any JSON: no stop is refused for it."""
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)


def told_id(press: Press, given: str) -> str:
    """Return the id that a press's sender is told: `given`, unless that is empty or longer than `MAX_GIVEN`."""
    return given if 0 < len(given) <= MAX_GIVEN else press.id


class NewPress(NamedTuple):
    """A press to be sent now. `replaced`: the press that it replaces; None if there was room."""

    press: Press
    replaced: Press | None


class Held(NamedTuple):
    """A press to be sent with the next `take_held`. `replaced`: as in `NewPress`."""

    press: Press
    replaced: Press | None


class UnderWay(NamedTuple):
    """A repeat of the pending `press`, or a press that shares the outcome of the one held for its link."""

    press: Press


class AlreadyTaken(NamedTuple):
    """A press that the robot has answered already."""

    taken: StopTaken


PressOutcome = NewPress | Held | UnderWay | AlreadyTaken


class Settled(NamedTuple):
    """A press that the robot has answered just now; `taken` names it."""

    press: Press
    taken: StopTaken


class StopPresses:
    """Keeps presses. Pass it each press with `press`, each answer with `taken`; send `pending` when a link comes up."""

    def __init__(self) -> None:
        self._pending: dict[str, Press] = {}  # by id, oldest first
        self._same: dict[str, list[Press]] = {}  # id of a pending press -> those that have its outcome
        self._leader: dict[str, str] = {}  # id of a press -> id of the pending one whose outcome it has
        self._held: dict[str, str] = {}  # link -> id of its pending press that was not sent yet
        self._taken: OrderedDict[str, StopTaken] = OrderedDict()

    @property
    def pending(self) -> list[Press]:
        """The presses without an answer, in the order in which they were made."""
        return list(self._pending.values())

    def is_pending(self, press: str) -> bool:
        return press in self._pending or press in self._leader

    def knows(self, press: str) -> bool:
        """True if a press of this id would be a repeat."""
        return press in self._taken or self.is_pending(press)

    def outcome(self, press: str) -> StopTaken | None:
        """Return the bridge's answer; None if there was no answer, or it was long ago."""
        return self._taken.get(press)

    def forget(self, press: str) -> None:
        """Forget the outcome: the id stands for a new press from now on, unless the press is pending."""
        self._taken.pop(press, None)

    def press(self, press: Press, *, hold: bool = False) -> PressOutcome:
        """Add a press, or recognise a repeat of one. `hold`: its link presses too fast."""
        known = self._taken.get(press.id)
        if known is not None:
            return AlreadyTaken(known)
        if self.is_pending(press.id):
            return UnderWay(self._pending[self._leader.get(press.id, press.id)])
        if not hold:
            return NewPress(press, self._add(press))
        if (held := self._held.get(press.by.link)) is not None:
            self._join(press, held)
            return UnderWay(self._pending[held])
        replaced = self._add(press)
        self._held[press.by.link] = press.id
        return Held(press, replaced)

    def take_held(self) -> list[Press]:
        """Return the held presses, which are to be sent now, and hold them no longer."""
        held, self._held = self._held, {}
        return [self._pending[press] for press in held.values()]

    def again(self, press: Press) -> bool:
        """Make a press pending again, to tell it to another epoch of the bridge; False if it was pending already."""
        self._taken.pop(press.id, None)
        if self.is_pending(press.id):
            return False
        self._add(press)
        return True

    def taken(self, taken: StopTaken) -> list[Settled]:
        """Take the bridge's answer; return all presses that it settles, first the one that it names."""
        self._remember(taken)
        press = self._pending.pop(taken.press, None)
        if press is None:
            return []
        self._let_go(press)
        settled = [Settled(press, taken)]
        for same in self._same.pop(taken.press, []):
            self._leader.pop(same.id, None)
            answer = msgspec.structs.replace(taken, press=same.id)
            self._remember(answer)
            settled.append(Settled(same, answer))
        return settled

    def _add(self, press: Press) -> Press | None:
        replaced = None
        if len(self._pending) >= MAX_PENDING:
            newest, replaced = self._pending.popitem()
            self._let_go(replaced)
            same = [replaced, *self._same.pop(newest, [])]
            for forgotten in same[MAX_SAME:]:
                self._leader.pop(forgotten.id, None)
            self._same[press.id] = same[:MAX_SAME]
            self._leader.update((each.id, press.id) for each in same[:MAX_SAME])
        self._pending[press.id] = press
        return replaced

    def _join(self, press: Press, leader: str) -> None:
        same = self._same.setdefault(leader, [])
        if len(same) < MAX_SAME:
            same.append(press)
            self._leader[press.id] = leader

    def _let_go(self, press: Press) -> None:
        if self._held.get(press.by.link) == press.id:
            del self._held[press.by.link]

    def _remember(self, taken: StopTaken) -> None:
        self._taken[taken.press] = taken
        self._taken.move_to_end(taken.press)
        while len(self._taken) > MAX_REMEMBERED:
            self._taken.popitem(last=False)
