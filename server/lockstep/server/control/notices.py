"""Tells everyone of the events of a session, and newcomers of what they have missed."""

from collections.abc import Callable, Iterator, Sequence

from lockstep.protocol.console import Notice, ServerMessage, StopStateNotice
from lockstep.server.audit.records import AuditTrouble
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import (
    ActionUpdated,
    LinkDown,
    LinkUp,
    NavigationReceived,
    NewcomerWelcomed,
    NoteWritten,
    ParticipantsChanged,
    RobotTaken,
    SeatChanged,
    SessionEvents,
    SpeedCapChanged,
    StatusReceived,
    StopsDiskChanged,
    StopSent,
    StopShown,
)

__all__ = ["Notices"]

TAKEN = "Another console has taken the robot. This console cannot drive it; STOP works while its media link is up."
UNDELIVERED = "The stop was not delivered: the robot link is down. The stop is sent first when it is back."
STOPS_UNWRITTEN = "Stops cannot be kept on this console's disk ({}). They are kept in memory, until this console ends."
STOPS_WRITTEN = "Stops can be kept on this console's disk again."
AUDIT_UNWRITTEN = (
    "The audit log cannot be written ({}). The console goes on; what happens now may be missing from the log."
)
AUDIT_WRITTEN = "The audit log is written again."


class Notices:
    """A subscriber to the events of a session.

    Args:
        states: each returns a message for newcomers, besides what the console itself tells them
        stops_trouble: why stops cannot be kept on disk now, or ""
    """

    def __init__(
        self, peers: PeerRegistry, states: Sequence[Callable[[], ServerMessage]] = (), stops_trouble: str = ""
    ) -> None:
        self._peers = peers
        self._states = states
        self._stops_trouble = stops_trouble
        self._audit_trouble = ""

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(NewcomerWelcomed, self._newcomer_welcomed)
        events.subscribe(LinkUp, self._link_changed)
        events.subscribe(LinkDown, self._link_changed)
        events.subscribe(RobotTaken, self._robot_taken)
        events.subscribe(SeatChanged, self._seat_changed)
        events.subscribe(SpeedCapChanged, self._speed_cap_changed)
        events.subscribe(ParticipantsChanged, self._participants_changed)
        events.subscribe(NoteWritten, self._note_written)
        events.subscribe(ActionUpdated, self._action_updated)
        events.subscribe(StatusReceived, self._status_received)
        events.subscribe(NavigationReceived, self._navigation_received)
        events.subscribe(StopShown, self._stop_shown)
        events.subscribe(StopSent, self._stop_sent)
        events.subscribe(StopsDiskChanged, self._stops_disk_changed)
        events.subscribe(AuditTrouble, self._audit_trouble_changed)

    def _newcomer_welcomed(self, event: NewcomerWelcomed) -> None:
        if (peer := self._peers.by_id(event.peer.peer)) is not None:
            for message in self.for_newcomers():
                peer.send("session", message)

    def for_newcomers(self) -> Iterator[ServerMessage]:
        for state in self._states:
            yield state()
        if self._stops_trouble:
            yield Notice(level="warning", text=STOPS_UNWRITTEN.format(self._stops_trouble))
        if self._audit_trouble:
            yield Notice(level="warning", text=AUDIT_UNWRITTEN.format(self._audit_trouble))

    def _link_changed(self, event: LinkUp | LinkDown) -> None:
        if event.state is not None:
            self._peers.announce(event.state)

    def _robot_taken(self, event: RobotTaken) -> None:
        self._peers.announce(Notice(level="error", text=TAKEN))

    def _seat_changed(self, event: SeatChanged) -> None:
        self._peers.announce(event.seat)

    def _speed_cap_changed(self, event: SpeedCapChanged) -> None:
        self._peers.announce(event.state)

    def _participants_changed(self, event: ParticipantsChanged) -> None:
        self._peers.announce(event.participants)

    def _note_written(self, event: NoteWritten) -> None:
        self._peers.announce(event.note)

    def _action_updated(self, event: ActionUpdated) -> None:
        self._peers.announce(event.update)

    def _status_received(self, event: StatusReceived) -> None:
        self._peers.announce(event.status)

    def _navigation_received(self, event: NavigationReceived) -> None:
        self._peers.announce(event.navigation)

    def _stop_shown(self, event: StopShown) -> None:
        self._peers.announce(StopStateNotice(stop=event.stop, event=event.event), "stop")

    def _stop_sent(self, event: StopSent) -> None:
        if event.alone and not event.delivered:
            self._peers.announce(Notice(level="error", text=UNDELIVERED))

    def _stops_disk_changed(self, event: StopsDiskChanged) -> None:
        self._stops_trouble = event.trouble
        self._tell_of_disk(event.trouble, STOPS_UNWRITTEN, STOPS_WRITTEN)

    def _audit_trouble_changed(self, event: AuditTrouble) -> None:
        self._audit_trouble = event.trouble
        self._tell_of_disk(event.trouble, AUDIT_UNWRITTEN, AUDIT_WRITTEN)

    def _tell_of_disk(self, trouble: str, unwritten: str, written: str) -> None:
        if trouble:
            self._peers.announce(Notice(level="warning", text=unwritten.format(trouble)))
        else:
            self._peers.announce(Notice(level="info", text=written))
