"""Lockstep's own records in words, for people who look at the log topic. No I/O."""

from typing import NamedTuple

from lockstep.server.recording.format.records import (
    ActionRecord,
    Degraded,
    EpisodeRecord,
    NoteRecord,
    OwnRecord,
    RefusalRecord,
    RestRecord,
    RobotRecord,
    SeatRecord,
    StopRecord,
)

__all__ = ["Words", "in_words"]


class Words(NamedTuple):
    text: str
    warning: bool = False


def in_words(record: OwnRecord) -> Words | None:
    """Return the record in words; None if it comes too often to be read, or says nothing."""
    match record:
        case RobotRecord(link=link, detail=detail):
            return Words(f"robot link {link}{': ' + detail if detail else ''}", link == "down")
        case SeatRecord(holder="", why=why):
            return Words(f"nobody drives ({why})" if why else "nobody drives")
        case SeatRecord(name=name, role="policy", why=why):
            return Words(f"policy {name} drives ({why})")
        case SeatRecord(name=name, why=why):
            return Words(f"{name} drives ({why})")
        case StopRecord(kind="taken", by=by, number=number, kept=kept):
            words = f"stop {number} of {by or 'somebody'} is latched{'' if kept else ', not on the disk of the robot'}"
            return Words(words, not kept)
        case StopRecord(kind=kind, by=by, where=where, reason=reason, number=number):
            named = f" of stop {number}" if number else ""
            words = f"{kind}{named} by {by or 'somebody'} ({where}){': ' + reason if reason else ''}"
            return Words(words, kind == "stop")
        case ActionRecord(state="running"):
            return None  # its progress; "asked" tells the begin
        case ActionRecord(name=name, state=state, by=by, reason=reason, text=text):
            why = ", ".join(filter(None, (reason, text)))
            words = f"action {name or 'that moves'} {state} by {by or 'the console'}{': ' + why if why else ''}"
            return Words(words, state in ("failed", "cancelled", "refused"))
        case RefusalRecord(refused=event, reason=reason, by=by):
            return Words(f"{by} refused {'event ' + str(event) if event else 'a request'}: {reason}", True)
        case RestRecord(why=why) if why:
            return Words(f"rest: {why}")
        case NoteRecord(name=name, text=text):
            return Words(f"{name}: {text}")
        case EpisodeRecord(kind="mark", number=number, text=text):
            return Words(f"episode {number}: {text}")
        case EpisodeRecord(kind=kind, number=number, task=task, outcome=outcome, why=why):
            said = ", ".join(filter(None, (outcome, why)))
            return Words(f"episode {number} {kind}{': ' + said if said else ''} ({task})", kind == "cut")
        case Degraded(lost=lost):
            return Words(f"the recorder left out {lost} records", True)
    return None
