"""Tells everyone of the events of a session, and newcomers of what they have missed."""

from collections.abc import Callable, Iterator, Sequence
from typing import assert_never, get_args

from lockstep.protocol.console import Notice, ServerMessage, StopStateNotice
from lockstep.server.audit.records import AuditTrouble
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import (
    ActionUpdated,
    NavigationReceived,
    NewcomerWelcomed,
    NoteWritten,
    ParticipantsChanged,
    RobotLinkDown,
    RobotLinkUp,
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

Told = (
    RobotLinkUp
    | RobotLinkDown
    | RobotTaken
    | SeatChanged
    | SpeedCapChanged
    | ParticipantsChanged
    | NoteWritten
    | ActionUpdated
    | StatusReceived
    | NavigationReceived
    | StopShown
    | StopSent
    | StopsDiskChanged
    | AuditTrouble
)


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
        for kind in get_args(Told):
            events.subscribe(kind, self._tell)

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

    def _tell(self, event: Told) -> None:
        announce = self._peers.announce
        match event:
            case RobotLinkUp() | RobotLinkDown():
                if event.state is not None:
                    announce(event.state)
            case RobotTaken():
                announce(Notice(level="error", text=TAKEN))
            case SeatChanged():
                announce(event.seat)
            case SpeedCapChanged():
                announce(event.state)
            case ParticipantsChanged():
                announce(event.participants)
            case NoteWritten():
                announce(event.note)
            case ActionUpdated():
                announce(event.update)
            case StatusReceived():
                announce(event.status)
            case NavigationReceived():
                announce(event.navigation)
            case StopShown():
                announce(StopStateNotice(stop=event.stop, event=event.event), "stop")
            case StopSent():
                if event.alone and not event.delivered:
                    announce(Notice(level="error", text=UNDELIVERED))
            case StopsDiskChanged():
                self._stops_trouble = event.trouble
                announce(_disk_notice(event.trouble, STOPS_UNWRITTEN, STOPS_WRITTEN))
            case AuditTrouble():
                self._audit_trouble = event.trouble
                announce(_disk_notice(event.trouble, AUDIT_UNWRITTEN, AUDIT_WRITTEN))
            case _:
                assert_never(event)


def _disk_notice(trouble: str, unwritten: str, written: str) -> Notice:
    if trouble:
        return Notice(level="warning", text=unwritten.format(trouble))
    return Notice(level="info", text=written)
