"""Tells peers what is refused to them, and publishes it."""

from lockstep.protocol.messages import Refusal, RefusalReason
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.peer import Peer
from lockstep.server.session_events import Refused, SessionEvents

__all__ = ["Refusals"]


class Refusals:
    """The console's refusals. Every method is called on the loop and returns at once."""

    def __init__(self, clock: EventClock, events: SessionEvents) -> None:
        self._clock = clock
        self._events = events

    def refuse(self, peer: Peer, channel: ChannelName, reason: RefusalReason, detail: str = "") -> None:
        """Refuse something that names no event."""
        self.send(peer, channel, Refusal(event=0, reason=reason, current=self._clock.event, detail=detail))

    def send(self, peer: Peer, channel: ChannelName, refusal: Refusal) -> None:
        peer.send(channel, refusal)
        self._events.publish(Refused(peer.actor, channel, refusal, "console"))
