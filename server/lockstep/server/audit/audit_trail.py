"""The audit trail: makes records of what happens, with the current event reference, and passes them to the log."""

import asyncio
import time
from collections.abc import Iterator
from typing import Protocol

from lockstep.protocol.console import Seat
from lockstep.server.audit.records import LIMITED, Actor, AuditBudget, AuditKind, AuditMerger, AuditRecord
from lockstep.server.event_clock import EventClock

__all__ = ["AuditTrail", "RecordKeeper"]

NOBODY = Actor()
BEYOND = "this link causes too many records; they are counted together"
MERGE_SECONDS = 1.0  # repetitions become one record
SLOW_TICKS = 60  # times that: what is beyond a link's budget becomes one record


class RecordKeeper(Protocol):
    """The log. `append` returns at once; iterating gives the last records, oldest first."""

    @property
    def next_number(self) -> int: ...

    def __iter__(self) -> Iterator[AuditRecord]: ...
    def append(self, record: AuditRecord) -> None: ...


class AuditTrail:
    """Makes the audit's records. Run `run` as a task; all else is called on the loop and returns at once."""

    def __init__(self, clock: EventClock, log: RecordKeeper) -> None:
        self._clock = clock
        self._log = log
        self._next = log.next_number
        self._merger = AuditMerger()
        self._budget = AuditBudget()
        self._beyond = AuditMerger()  # records beyond the budget
        self._ticks = 0
        self._holder = Actor()
        self._holder_is_noted = True  # the newest record of the seat says who has it
        self._claims: list[str] = []
        self._offered = False  # to policies
        self._description = next((each.what for each in reversed([*log]) if each.kind == "epoch"), "")

    def record(self, kind: AuditKind, actor: Actor = NOBODY, what: str = "", detail: str = "") -> None:
        """Write a record of `kind` now. Some kinds are only counted beyond the link's budget."""
        self._record(kind, actor, what, detail)

    def _record(self, kind: AuditKind, actor: Actor, what: str, detail: str) -> bool:
        """Record like `record`; True if it was written, False if it was only counted."""
        if kind in LIMITED and not self._budget.take(kind, actor.link, time.monotonic()):
            self._beyond.add(kind, _link_alone(actor), what)
            return False
        self._write(kind, actor, what, detail)
        return True

    def _write(self, kind: AuditKind, actor: Actor, what: str, detail: str = "", count: int = 1) -> None:
        feedback = self._clock.feedback
        self._log.append(
            AuditRecord(
                n=self._next,
                time=round(time.time(), 3),
                kind=kind,
                epoch=self._clock.epoch,
                event=0 if feedback is None else feedback.event,
                who=actor.name,
                role=actor.role,
                peer=actor.peer,
                link=actor.link,
                what=what,
                detail=detail,
                count=count,
            )
        )
        self._next += 1

    def started(self, console: str, page: str, protocol: int) -> None:
        """Record that the console starts, with its software's versions."""
        self.record("start", what=f"console {console}", detail=f"page {page}, robot link protocol {protocol}")

    def epoch(self, label: str, description: str) -> None:
        """Record another run of the bridge, with the hash of its robot's description and the last one if it differs."""
        what = f"description {description}"
        changed = f"; was {self._description}" if self._description not in ("", what) else ""
        self.record("epoch", what=what, detail=f"{label}{changed}")
        self._description = what

    def seat(self, seat: Seat, holder: Actor, by: Actor) -> None:
        """Record that the seat changed because of `by`: its holder is `holder`, or nobody, or other peers claim it."""
        claims = [claim.peer for claim in seat.claims]
        if holder.peer != self._holder.peer:
            detail = f"was {self._holder.name} ({self._holder.peer})" if self._holder.peer else ""
            what = seat.why if holder.peer else f"{seat.why}, free"
            self._holder_is_noted = self._record("seat", holder if holder.peer else self._holder, what, detail)
            self._holder = holder
        if claims != self._claims:
            self.record("claim", by, detail=", ".join(f"{each.name} ({each.peer})" for each in seat.claims) or "none")
            self._claims = claims
        if seat.offered != self._offered:
            what = "offered to policies" if seat.offered else "no longer offered"
            self.record("seat", by, what, seat.offered_to)
            self._offered = seat.offered

    def again(self, kind: AuditKind, actor: Actor, what: str) -> None:
        """Count a record that is merged with its repetitions, for what may come many times a second."""
        self._merger.add(kind, actor, what)

    def refused(self, actor: Actor, reason: str) -> None:
        self.again("refusal", actor, reason)

    async def run(self) -> None:
        """Write merged records every `MERGE_SECONDS`, until cancelled."""
        try:
            while True:
                await asyncio.sleep(MERGE_SECONDS)
                self._ticks += 1
                self.flush(beyond=self._ticks % SLOW_TICKS == 0)
        finally:
            self.flush(beyond=True)

    def flush(self, *, beyond: bool = False) -> None:
        """Write what was merged until now; with `beyond` also what went beyond the links' budgets."""
        now = time.monotonic()
        self._note_holder(now)
        for kind, actor, what, count in self._merger.take():
            if self._budget.take(kind, actor.link, now):
                self._write(kind, actor, what, count=count)
            else:
                self._beyond.add(kind, _link_alone(actor), what, count)
        if beyond:
            self._budget.forget_idle(now)
            for kind, actor, what, count in self._beyond.take():
                self._write(kind, actor, what, BEYOND, count)

    def _note_holder(self, now: float) -> None:
        """Record the holder of a seat that changed hands too often to be recorded each time."""
        if not self._holder_is_noted and self._budget.take("seat", self._holder.link, now):
            self._holder_is_noted = True
            self._write("seat", self._holder, "has it now" if self._holder.peer else "free now")


def _link_alone(actor: Actor) -> Actor:
    """Return the link's actor: what its peers do counts together, whatever they are called."""
    return Actor(role=actor.role, link=actor.link)
