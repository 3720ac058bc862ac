"""The people on the console: the list of them, their names, and their notes to each other."""

import asyncio
import time
from collections.abc import Callable

from lockstep.protocol.console import Participant, Participants, SharedNote
from lockstep.protocol.messages import RefusalReason
from lockstep.server.control.notes import NoteBoard
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import (
    NoteWritten,
    ParticipantsChanged,
    PeerJoined,
    PeerLeft,
    PeerRenamed,
    SessionEvents,
)
from lockstep.server.util.display_names import clean_name, unique_names

__all__ = ["ParticipantList"]

FEW = 10  # participants up to which everybody's measured values are shared
CROWD = 10  # peers; the list of participants goes out at most once a second, ten times more rarely to 100


class ParticipantList:
    """Keeps the list of participants. Run `share` as a task; everything else is called on the loop and returns at once.

    Args:
        renamed: called with the peers whose names have changed
    """

    def __init__(
        self,
        peers: PeerRegistry,
        clock: EventClock,
        events: SessionEvents,
        renamed: Callable[[list[Peer]], None],
    ) -> None:
        self._peers = peers
        self._clock = clock
        self._events = events
        self._renamed = renamed
        self._board = NoteBoard()

    def current(self) -> Participants:
        """Return all, those who may drive first. In a crowd only they have measured values: the list changes less."""
        found = []
        for peer in self._people():
            with peer.contained("participant"):
                found.append(_participant(peer))
        everyone = sorted(found, key=lambda each: each.role == "observer")
        return Participants(
            participants=[
                each if len(everyone) <= FEW or each.role != "observer" else _without_values(each) for each in everyone
            ]
        )

    def joined(self, peer: Peer) -> None:
        self._give_names()
        if peer.thumbnail:
            peer.name = peer.wanted_name  # not in the list, but a stop names its sender
            return
        self._board.joined(time.monotonic())
        carriers = ", ".join(sorted({stream.carrier for stream in peer.media.streams}))
        self._events.publish(PeerJoined(peer.actor, carriers))

    def left(self, peer: Peer) -> None:
        if not peer.thumbnail:
            self._events.publish(PeerLeft(peer.actor, peer.ended))
            if all(each.thumbnail or each.ended for each in self._peers):  # a peer that is closing no longer counts
                self._board.left_empty(time.monotonic())

    def welcome(self, peer: Peer) -> None:
        """Tell a newcomer who is here and what was written."""
        peer.send("session", self.current())
        for note in self._board:
            peer.send("session", note)

    def rename(self, peer: Peer, name: str) -> None:
        before = peer.name
        peer.wanted_name = clean_name(name, clean_name(peer.identity.name, peer.role))
        self.settle_names()
        if peer.name != before:
            self._events.publish(PeerRenamed(peer.actor, before))

    def settle_names(self) -> None:
        """Give every peer a distinct name; a name is free again when its owner leaves."""
        changed = self._give_names()
        if changed:
            self._renamed(changed)

    def _give_names(self) -> list[Peer]:
        """Give everyone the name they asked for, or that with a number. Return the peers whose name changed."""
        people = self._people()
        names = unique_names([(peer.wanted_name, peer.name) for peer in people])
        changed = []
        for peer, name in zip(people, names, strict=True):
            if peer.name != name:
                peer.name = name
                changed.append(peer)
        return changed

    def _people(self) -> list[Peer]:
        return [peer for peer in self._peers if not peer.thumbnail]

    def write(self, peer: Peer, text: str) -> RefusalReason | None:
        """Send a note to everyone. Return the reason if it is refused, else None."""
        link, epoch, event = peer.identity.token_id, self._clock.epoch, self._clock.event
        note = self._board.write(link, peer.id, peer.name, peer.role, text, epoch, event, time.monotonic(), time.time())
        if not isinstance(note, SharedNote):
            return note
        self._events.publish(NoteWritten(peer.actor, note))
        return None

    async def share(self) -> None:
        """Send everyone the list of participants whenever it has changed, until cancelled."""
        shown = Participants(participants=[])
        while True:
            await asyncio.sleep(max(1.0, len(self._peers) / CROWD))
            self.settle_names()
            current = self.current()
            if current != shown:
                shown = current
                self._events.publish(ParticipantsChanged(current))


def _participant(peer: Peer) -> Participant:
    media, carriers = peer.media, [stream.carrier for stream in peer.media.streams]
    return Participant(
        peer=peer.id,
        name=peer.name,
        role=peer.role,
        carrier=carriers[0] if carriers else "trailer" if peer.relay else "none",
        gap=max((stream.gap for stream in peer.report.streams), key=abs, default=0),
        picture_delay_ms=peer.report.picture_delay_ms,
        round_trip_ms=peer.report.round_trip_ms,
        loss=None if media.loss is None else round(media.loss, 2),
        tier=media.tier,
        silenced=peer.silenced,
    )


def _without_values(participant: Participant) -> Participant:
    return Participant(
        peer=participant.peer,
        name=participant.name,
        role=participant.role,
        carrier=participant.carrier,
        silenced=participant.silenced,
    )
