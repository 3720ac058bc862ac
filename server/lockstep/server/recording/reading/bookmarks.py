"""Finds the marks of a recording that a viewer jumps to: contacts, refusals, stops, hand-overs. No I/O."""

import math
from typing import Literal

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.format.records import (
    ActionRecord,
    EpisodeRecord,
    FeedbackRecord,
    NoteRecord,
    OwnRecord,
    RefusalRecord,
    RobotRecord,
    SeatRecord,
    Whole,
)

__all__ = ["Mark", "BookmarkFinder", "MarkKind"]

MarkKind = Literal["contact", "refusal", "stop", "reset", "seat", "note", "fault", "link", "action", "episode"]
REFUSAL_SPACING = 1_000_000  # µs
STOP_SPACING = 1_000_000  # µs between marks of further stops, while one holds
RELEASE_SHARE = 0.6  # of the threshold: a contact ends below it, so that a trembling force is one contact


class Mark(msgspec.Struct, frozen=True):
    event: Whole
    time: Whole  # µs since 1970, arrival
    kind: MarkKind
    text: str = ""


class BookmarkFinder:
    """Finds the marks of a recording. Show it every record of Lockstep's own, in order."""

    def __init__(self, description: RobotDescription | None = None) -> None:
        self._threshold = _threshold(description)
        self._touching = False
        self._stopped = False
        self._stop_number = 0  # of the newest stop that is known
        self._last_stop = -math.inf
        self._faults: list[str] = []
        self._holder: str | None = None  # None: not known yet
        self._link = ""
        self._last_refusal = -math.inf

    def find(self, record: OwnRecord, arrived: int) -> list[Mark]:
        """Return the marks of `record`, which arrived at `arrived` (µs)."""
        match record:
            case FeedbackRecord():
                return self._feedback(record, arrived)
            case RefusalRecord():
                return self._refusal(record, arrived)
            case SeatRecord(holder=holder) if holder != self._holder:
                known, self._holder = self._holder is not None, holder
                words = f"{record.name or 'free'} ({record.why})"
                return [Mark(record.event, arrived, "seat", words)] if known else []
            case ActionRecord(state=state) if state not in ("running", "cancel"):
                words = ": ".join(filter(None, (f"{record.name} {state}", record.reason or record.text)))
                return [Mark(record.event, arrived, "action", words[:200])]
            case EpisodeRecord():
                what = record.text if record.kind == "mark" else " ".join(filter(None, (record.kind, record.outcome)))
                return [Mark(record.event, arrived, "episode", f"{record.number} {what}: {record.task}"[:200])]
            case NoteRecord():
                return [Mark(record.event, arrived, "note", f"{record.name}: {record.text}"[:200])]
            case RobotRecord():
                self._threshold = _threshold(record.description)
                changed, self._link = self._link not in ("", record.link), record.link
                return [Mark(record.event, arrived, "link", f"robot link {record.link}")] if changed else []
        return []

    # Feedback tells the times of a stop and its reset, not the records of the requests.

    def _feedback(self, record: FeedbackRecord, arrived: int) -> list[Mark]:
        found: list[Mark] = []
        found += self._stop(record, arrived)
        if record.faults != self._faults:
            found += [Mark(record.event, arrived, "fault", text) for text in record.faults if text not in self._faults]
            self._faults = record.faults
        if self._threshold is not None and len(record.wrench) >= 3:
            force = math.hypot(*record.wrench[:3])
            if not self._touching and force > self._threshold:
                self._touching = True
                found.append(Mark(record.event, arrived, "contact", f"{force:.3g} N"))
            elif self._touching and force < RELEASE_SHARE * self._threshold:
                self._touching = False
        return found

    def _stop(self, record: FeedbackRecord, arrived: int) -> list[Mark]:
        stop = record.stop
        newer, self._stop_number = stop.number > self._stop_number, max(stop.number, self._stop_number)
        if stop.stopped != self._stopped:
            self._stopped = stop.stopped
            words = f"{stop.by}: {stop.reason}".strip(": ")
            self._last_stop = arrived
            return [Mark(record.event, arrived, "stop" if self._stopped else "reset", words)]
        if newer and stop.stopped and arrived - self._last_stop >= STOP_SPACING:
            self._last_stop = (
                arrived  # its reset and the next stop came between two feedbacks, or somebody pressed again
            )
            return [Mark(record.event, arrived, "stop", f"again, stop {stop.number}")]
        return []

    def _refusal(self, record: RefusalRecord, arrived: int) -> list[Mark]:
        if arrived - self._last_refusal < REFUSAL_SPACING:
            return []
        self._last_refusal = arrived
        return [Mark(record.event, arrived, "refusal", f"{record.reason} {record.name}".strip())]


def _threshold(description: RobotDescription | None) -> float | None:
    return None if description is None or description.wrench is None else description.wrench.threshold_force
