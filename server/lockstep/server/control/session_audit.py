"""Records the events of a session in the audit trail."""

import time
from typing import assert_never, get_args

from lockstep.protocol.messages import PROTOCOL_VERSION
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor, AuditTrouble
from lockstep.server.http.versions import console_version, description_hash, page_build
from lockstep.server.session_events import (
    ActionAsked,
    ActionCancelled,
    ActionRefused,
    ActionUpdated,
    EpochBegan,
    NoteWritten,
    PeerJoined,
    PeerLeft,
    PeerRenamed,
    Refused,
    ResetDone,
    ResetRefused,
    RobotLinkDown,
    RobotLinkUp,
    RobotTaken,
    SeatChanged,
    SessionBegan,
    SessionEvents,
    SilenceChanged,
    StopAnswered,
    StopRepeated,
    StopsDiskChanged,
    StopSilenced,
    StopUndelivered,
)
from lockstep.server.stop.stop_presses import Press
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["SessionAudit"]

STOPS, STOP_RATE = 5, 0.2  # Hz, of stops of one link that are recorded in full; the others are counted

Audited = (
    SessionBegan
    | EpochBegan
    | RobotLinkUp
    | RobotLinkDown
    | RobotTaken
    | AuditTrouble
    | SeatChanged
    | PeerJoined
    | PeerLeft
    | PeerRenamed
    | NoteWritten
    | Refused
    | ActionAsked
    | ActionCancelled
    | ActionRefused
    | ActionUpdated
    | StopSilenced
    | StopRepeated
    | StopUndelivered
    | StopAnswered
    | ResetDone
    | ResetRefused
    | SilenceChanged
    | StopsDiskChanged
)


class SessionAudit:
    """A subscriber to the events of a session."""

    def __init__(self, audit: AuditTrail) -> None:
        self._audit = audit
        self._stops = RateLimits(STOP_RATE, STOPS)

    def subscribe(self, events: SessionEvents) -> None:
        for kind in get_args(Audited):
            events.subscribe(kind, self._record)

    def _record(self, event: Audited) -> None:
        audit = self._audit
        match event:
            case SessionBegan():
                audit.started(console_version(), page_build(), PROTOCOL_VERSION)
            case EpochBegan():
                audit.epoch(event.description.label, description_hash(event.description))
            case RobotLinkUp():
                audit.record("link_up")
            case RobotLinkDown():
                if event.was_up:
                    audit.record("link_down", detail=event.detail)
            case RobotTaken():
                audit.record("link_down", what="taken", detail=event.detail)
            case AuditTrouble():
                if not event.trouble:
                    audit.record("audit", what="written again", detail=f"{event.lost} records lost since the start")
            case SeatChanged():
                audit.seat(event.seat, event.holder, event.by)
            case PeerJoined():
                audit.record("joined", event.peer, event.carriers)
            case PeerLeft():
                audit.record("left", event.peer, event.why)
            case PeerRenamed():
                audit.record("renamed", event.peer, detail=f"was {event.before}")
            case NoteWritten():
                audit.record("note", event.by, detail=event.note.text)
            case Refused():  # stops and resets have records of their own, also when they come by HTTP
                if event.to.peer and event.channel != "stop":
                    audit.refused(event.to, event.refusal.reason)
            case ActionAsked():
                audit.record("action", event.by, "asked", event.act.name)
            case ActionCancelled():
                audit.again("action", event.by, "cancel, the seat changes" if event.by == Actor() else "cancel")
            case ActionRefused():
                audit.refused(event.by, event.update.reason)
            case ActionUpdated():
                update = event.update
                if event.new_state and update.state != "running":
                    outcome = f"{update.state}, {update.reason}" if update.reason else update.state
                    audit.record("action", what=outcome, detail=f"{update.name}, by {update.by}")
            case StopSilenced():
                audit.refused(event.by, "silenced")
            case StopRepeated():
                audit.again("stop", event.by, f"{event.where}, again")
            case StopUndelivered():
                self._record_stop(event.press, f"{event.press.where}, not delivered yet")
            case StopAnswered():
                self._record_stop(event.press, _outcome_of_stop(event))
            case ResetDone():
                audit.record("reset", event.by, event.where, f"stop {event.number}")
            case ResetRefused():
                audit.again("reset", event.by, f"{event.where}, refused {event.reason}")
            case SilenceChanged():
                what = "silenced" if event.silent else "heard again"
                audit.record("silence", event.by, what, f"{event.name} ({event.link})")
            case StopsDiskChanged():
                what = "kept in memory only" if event.trouble else "kept on disk again"
                audit.record("stop", what=what, detail=event.trouble)
            case _:
                assert_never(event)

    def _record_stop(self, press: Press, what: str) -> None:
        """Record the first stops of each link in full; a flood becomes one record a second."""
        if self._stops.spend(press.by.link or press.by.name, time.monotonic()):
            self._audit.record("stop", press.by, what, press.reason)
        else:
            self._audit.again("stop", press.by, f"{press.where}, more")


def _outcome_of_stop(event: StopAnswered) -> str:
    what = f"{event.press.where}{', sent again' if event.again else ''}, stop {event.taken.number}"
    what += "" if event.taken.kept else ", not on the robot's disk"
    return f"{what}{', reset before' if event.released else ''}"
