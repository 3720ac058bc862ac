"""Records the events of a session in the audit trail."""

import time

from lockstep.protocol.messages import PROTOCOL_VERSION
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import AuditTrouble
from lockstep.server.http.versions import console_version, description_hash, page_build
from lockstep.server.session_events import (
    ActionAsked,
    ActionCancelled,
    ActionRefused,
    ActionUpdated,
    EpochBegan,
    LinkDown,
    LinkUp,
    NoteWritten,
    PeerJoined,
    PeerLeft,
    PeerRenamed,
    Refused,
    ResetDone,
    ResetRefused,
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


class SessionAudit:
    """A subscriber to the events of a session."""

    def __init__(self, audit: AuditTrail) -> None:
        self._audit = audit
        self._stops = RateLimits(STOP_RATE, STOPS)

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(SessionBegan, self._session_began)
        events.subscribe(EpochBegan, self._epoch_began)
        events.subscribe(LinkUp, self._link_up)
        events.subscribe(LinkDown, self._link_down)
        events.subscribe(RobotTaken, self._robot_taken)
        events.subscribe(SeatChanged, self._seat_changed)
        events.subscribe(PeerJoined, self._peer_joined)
        events.subscribe(PeerLeft, self._peer_left)
        events.subscribe(PeerRenamed, self._peer_renamed)
        events.subscribe(NoteWritten, self._note_written)
        events.subscribe(Refused, self._refused)
        events.subscribe(StopSilenced, self._stop_silenced)
        events.subscribe(StopRepeated, self._stop_repeated)
        events.subscribe(StopUndelivered, self._stop_undelivered)
        events.subscribe(StopAnswered, self._stop_answered)
        events.subscribe(ResetDone, self._reset_done)
        events.subscribe(ResetRefused, self._reset_refused)
        events.subscribe(ActionAsked, self._action_asked)
        events.subscribe(ActionCancelled, self._action_cancelled)
        events.subscribe(ActionRefused, self._action_refused)
        events.subscribe(ActionUpdated, self._action_updated)
        events.subscribe(SilenceChanged, self._silence_changed)
        events.subscribe(StopsDiskChanged, self._stops_disk_changed)
        events.subscribe(AuditTrouble, self._audit_trouble)

    # the session and the robot

    def _session_began(self, event: SessionBegan) -> None:
        self._audit.started(console_version(), page_build(), PROTOCOL_VERSION)

    def _epoch_began(self, event: EpochBegan) -> None:
        self._audit.epoch(event.description.label, description_hash(event.description))

    def _link_up(self, event: LinkUp) -> None:
        self._audit.record("link_up")

    def _link_down(self, event: LinkDown) -> None:
        if event.was_up:
            self._audit.record("link_down", detail=event.detail)

    def _robot_taken(self, event: RobotTaken) -> None:
        self._audit.record("link_down", what="taken", detail=event.detail)

    def _audit_trouble(self, event: AuditTrouble) -> None:
        if not event.trouble:
            self._audit.record("audit", what="written again", detail=f"{event.lost} records lost since the start")

    # people

    def _seat_changed(self, event: SeatChanged) -> None:
        self._audit.seat(event.seat, event.holder, event.by)

    def _peer_joined(self, event: PeerJoined) -> None:
        self._audit.record("joined", event.peer, event.carriers)

    def _peer_left(self, event: PeerLeft) -> None:
        self._audit.record("left", event.peer, event.why)

    def _peer_renamed(self, event: PeerRenamed) -> None:
        self._audit.record("renamed", event.peer, detail=f"was {event.before}")

    def _note_written(self, event: NoteWritten) -> None:
        self._audit.record("note", event.by, detail=event.note.text)

    def _refused(self, event: Refused) -> None:
        """Stops and resets have records of their own, also when they come by HTTP."""
        if event.to.peer and event.channel != "stop":
            self._audit.refused(event.to, event.refusal.reason)

    # actions

    def _action_asked(self, event: ActionAsked) -> None:
        self._audit.record("action", event.by, "asked", event.act.name)

    def _action_cancelled(self, event: ActionCancelled) -> None:
        self._audit.again("action", event.by, "cancel" if event.by.peer else "cancel, the seat changes")

    def _action_refused(self, event: ActionRefused) -> None:
        self._audit.refused(event.by, event.update.reason)

    def _action_updated(self, event: ActionUpdated) -> None:
        update = event.update
        if event.new_state and update.state != "running":
            outcome = f"{update.state}, {update.reason}" if update.reason else update.state
            self._audit.record("action", what=outcome, detail=f"{update.name}, by {update.by}")

    # stops and resets

    def _stop_silenced(self, event: StopSilenced) -> None:
        self._audit.refused(event.by, "silenced")

    def _stop_repeated(self, event: StopRepeated) -> None:
        self._audit.again("stop", event.by, f"{event.where}, again")

    def _stop_undelivered(self, event: StopUndelivered) -> None:
        self._record_stop(event.press, f"{event.press.where}, not delivered yet")

    def _stop_answered(self, event: StopAnswered) -> None:
        what = f"{event.press.where}{', sent again' if event.again else ''}, stop {event.taken.number}"
        what += "" if event.taken.kept else ", not on the robot's disk"
        self._record_stop(event.press, f"{what}{', reset before' if event.released else ''}")

    def _record_stop(self, press: Press, what: str) -> None:
        """Record the first stops of each link in full; a flood becomes one record a second."""
        if self._stops.spend(press.by.link or press.by.name, time.monotonic()):
            self._audit.record("stop", press.by, what, press.reason)
        else:
            self._audit.again("stop", press.by, f"{press.where}, more")

    def _reset_done(self, event: ResetDone) -> None:
        self._audit.record("reset", event.by, event.where, f"stop {event.number}")

    def _reset_refused(self, event: ResetRefused) -> None:
        self._audit.again("reset", event.by, f"{event.where}, refused {event.reason}")

    def _silence_changed(self, event: SilenceChanged) -> None:
        what = "silenced" if event.silent else "heard again"
        self._audit.record("silence", event.by, what, f"{event.name} ({event.link})")

    def _stops_disk_changed(self, event: StopsDiskChanged) -> None:
        what = "kept in memory only" if event.trouble else "kept on disk again"
        self._audit.record("stop", what=what, detail=event.trouble)
