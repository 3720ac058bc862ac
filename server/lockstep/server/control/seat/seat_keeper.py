"""Applies the rules of the control seat and acts on their outcomes. The rest leaves before anyone is told."""

import asyncio
import time
from collections.abc import Iterable
from typing import Protocol

from lockstep.protocol.console import (
    PEOPLE,
    Seat,
    SeatDecline,
    SeatGrant,
    SeatOffer,
    SeatRelease,
    SeatRequest,
    SeatTake,
)
from lockstep.server.audit.records import Actor
from lockstep.server.control.refusals import Refusals
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_message import seat_message
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_table import SeatInput, SeatOutcome, Standing
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import SeatChanged, SessionEvents

__all__ = ["SeatHost", "SeatKeeper", "SeatMessage", "is_policy"]

CHECKS = 12  # within one heartbeat timeout
LINK_CLAIMS = 2  # at once by all connections of a link: there are few places for claims, and others want to ask too

SeatMessage = SeatRequest | SeatGrant | SeatDecline | SeatTake | SeatOffer | SeatRelease


class SeatHost(Protocol):
    """The part of the console that the keeper uses."""

    def rest_robot(self, why: str) -> None: ...


class SeatKeeper:
    """Keeps the seat. Run `watch` as a task; everything else is called on the loop and returns at once."""

    def __init__(
        self, seat: ControlSeat, peers: PeerRegistry, host: SeatHost, refusals: Refusals, events: SessionEvents
    ) -> None:
        self.state = seat
        self.rules = SeatRules(seat)
        self._peers = peers
        self._host = host
        self._refusals = refusals
        self._events = events

    def message(self) -> Seat:
        """Return the seat's state as everyone is told it."""
        return seat_message(self.state, self._peers, time.monotonic())

    def is_held_by(self, peer: Peer) -> bool:
        return self.state.holds(peer.id)

    def may_move(self, peer: Peer) -> bool:
        """True if `peer` holds the seat and has sent the neutral command that comes before any motion."""
        return self.state.may_move(peer.id)

    def is_held_with(self, link: str) -> bool:
        """True if a peer with the link of this id holds the seat."""
        holder = self._peers.by_id(self.state.holder)
        return holder is not None and holder.identity.token_id == link

    def waits_for_nothing(self, peer: Peer, message: object) -> bool:
        """True if this is a person's press that takes the robot from a policy: it is never refused as too often.

        It follows an offer, and those are counted.
        """
        takes = (
            isinstance(message, SeatTake)
            or (isinstance(message, SeatRequest) and not message.only_if_free)
            or (isinstance(message, SeatOffer) and not message.offered)
        )
        return takes and self.state.policy_drives and peer.role in PEOPLE

    def handle(self, peer: Peer, message: SeatMessage) -> None:
        """Act on a request of `peer`."""
        now, link = time.monotonic(), peer.identity.token_id
        match message:
            case SeatRequest(only_if_free=False) if (
                self.state.standing(peer.id) is Standing.OTHER
                and _with_link(link, map(self._peers.by_id, self.state.claims)) >= LINK_CLAIMS
            ):
                self._refusals.refuse(peer, "session", "seat_taken", "your link has requested the seat already")
            case SeatRequest(only_if_free=only_if_free):
                self.act(self.rules.request(peer.id, peer.role, now, only_if_free=only_if_free), peer)
            case SeatTake():
                self.act(self.rules.take(peer.id, peer.role, now), peer)
            case SeatGrant(peer=claimant):
                self.act(self.rules.answer(peer.id, claimant, now, grant=True), peer)
            case SeatDecline(peer=claimant):
                self.act(self.rules.answer(peer.id, claimant, now, grant=False), peer)
            case SeatOffer(offered=False):
                self.act(self.rules.withdraw_offer(peer.id, peer.role, now), peer)
            case SeatOffer(peer=policy) if policy and not is_policy(self._peers.by_id(policy)):
                self._refusals.refuse(peer, "session", "not_allowed", "this is no policy")
            case SeatOffer(peer=policy):
                self.act(self.rules.offer_to_policies(peer.id, peer.role, link, now, to=policy), peer)
            case SeatRelease():
                self.act(self.rules.release(peer.id, now), peer)

    def heard(self, peer: Peer) -> None:
        now, round_trip = time.monotonic(), (peer.media.round_trip_ms or 0.0) / 1000
        self.rules.heard(peer.id, now, round_trip)
        if peer.role in PEOPLE:
            self.rules.attended(peer.identity.token_id, now, round_trip)

    def moved(self, peer: Peer) -> None:
        """Called when a moving command of `peer` was forwarded."""
        self.act(self.rules.moved(peer.id, time.monotonic()), peer)

    def gone(self, peer: Peer) -> None:
        now = time.monotonic()
        self.act(self.rules.gone(peer.id, now), peer)
        link = peer.identity.token_id
        if not any(each.identity.token_id == link and each.role in PEOPLE and not each.ended for each in self._peers):
            self.act(self.rules.person_left(link, now), peer)

    def end_offer(self, what: SeatInput) -> None:
        """End the offer to policies, for a reason of the robot: one of `OFFER_ENDS`."""
        self.act(self.rules.end_offer(what, time.monotonic()), None)

    def renamed(self, peers: list[Peer]) -> None:
        """Tell everyone, if the seat's message names one of `peers`."""
        if any(self.state.standing(peer.id) in (Standing.HOLDER, Standing.CLAIMANT) for peer in peers):
            self._publish(Actor())

    async def watch(self) -> None:
        """Act on time limits that run out, until cancelled."""
        while True:
            await asyncio.sleep(min(self.state.times.heartbeat / CHECKS, 1.0))
            for outcome in self.rules.expire(time.monotonic()):
                self.act(outcome, None)

    def act(self, outcome: SeatOutcome, actor: Peer | Actor | None) -> None:
        """Act on the outcome of an input by `actor`; None: nobody's."""
        if outcome.rest:
            self._host.rest_robot(self.state.why)
        if outcome.changed:
            self._publish(_actor(actor))
            for peer in self._peers:
                peer.drives(self.state.holds(peer.id))
        if outcome.refusal is not None:
            refused = self._peers.by_id(outcome.refusal.peer)
            if refused is not None:
                self._refusals.refuse(refused, "session", outcome.refusal.reason, outcome.refusal.detail)

    def _publish(self, by: Actor) -> None:
        seat = self.message()
        self._events.publish(SeatChanged(seat, _actor(self._peers.by_id(seat.holder)), by))


def is_policy(peer: Peer | None) -> bool:
    return peer is not None and peer.role == "policy"


def _with_link(link: str, peers: Iterable[Peer | None]) -> int:
    return sum(peer is not None and peer.identity.token_id == link for peer in peers)


def _actor(who: Peer | Actor | None) -> Actor:
    return Actor() if who is None else who if isinstance(who, Actor) else who.actor
