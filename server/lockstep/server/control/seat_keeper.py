"""Applies the rules of the control seat and acts on their outcomes. The rest leaves before anyone is told."""

import asyncio
import time
from typing import Protocol

from lockstep.protocol.console import (
    PEOPLE,
    Seat,
    SeatClaim,
    SeatDecline,
    SeatGrant,
    SeatOffer,
    SeatRelease,
    SeatRequest,
    SeatTake,
    driver_kind,
)
from lockstep.server.audit.records import Actor
from lockstep.server.control.seat import ControlSeat, SeatInput, SeatOutcome, SeatRefusal, Standing
from lockstep.server.errors import NoSeat, NotAllowed, TooManyRequests
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import SeatChanged, SessionEvents

__all__ = ["SeatHost", "SeatKeeper", "SeatMessage"]

CHECKS = 12  # within one heartbeat timeout
LINK_CLAIMS = 2  # at once by all connections of a link: there are few places for claims, and others want to ask too

SeatMessage = SeatRequest | SeatGrant | SeatDecline | SeatTake | SeatOffer | SeatRelease


class SeatHost(Protocol):
    """The part of the console that the keeper uses."""

    def rest_robot(self, why: str) -> None: ...
    def refuse(self, peer: Peer, refusal: SeatRefusal) -> None: ...


class SeatKeeper:
    """Keeps the seat. Run `watch` as a task; everything else is called on the loop and returns at once."""

    def __init__(self, rules: ControlSeat, peers: PeerRegistry, host: SeatHost, events: SessionEvents) -> None:
        self.rules = rules
        self._peers = peers
        self._host = host
        self._events = events

    def message(self) -> Seat:
        """Return the seat's state as everyone is told it."""
        now, offer = time.monotonic(), self.rules.offer
        holder = self._peers.by_id(self.rules.holder) if self.rules.holder else None
        return Seat(
            holder=self.rules.holder,
            name=self._name(self.rules.holder),
            kind="none" if holder is None else driver_kind(holder.role),
            offered=offer is not None,
            offered_to="" if offer is None else offer.to,
            offered_by="" if offer is None else self._name(offer.by),
            why=self.rules.why,
            claims=[
                SeatClaim(peer=peer, name=self._name(peer), seconds_left=round(left, 1))
                for peer, left in self.rules.claims(now).items()
            ],
            idle_seconds_left=_rounded(self.rules.idle_seconds_left(now)),
        )

    def is_held_by(self, peer: Peer) -> bool:
        return self.rules.holds(peer.id)

    def may_move(self, peer: Peer) -> bool:
        """True if `peer` holds the seat and has sent the neutral command that comes before any motion."""
        return self.rules.may_move(peer.id)

    def is_held_with(self, link: str) -> bool:
        """True if a peer with the link of this id holds the seat."""
        holder = self._peers.by_id(self.rules.holder)
        return holder is not None and holder.identity.token_id == link

    # requests over HTTP, which carry a link and no peer

    def take_with(self, link: str, by: Actor) -> None:
        """End the turn of the policy that drives, for a person with this link. No I/O waits before the robot rests.

        The person's connection gets the seat, if exactly one has this link; else the seat is free.

        Raises:
            NotAllowed: this role may not, or another person holds the seat.
        """
        now, mine = time.monotonic(), self._people_with(link)
        if len(mine) == 1:
            outcome = self.rules.take(mine[0].id, mine[0].role, now)
        else:
            outcome = self.rules.withdraw_offer("", by.role, now)  # type: ignore[arg-type]
        self._act_for_link(outcome, mine[0] if len(mine) == 1 else by)

    def offer_with(self, link: str, by: Actor, *, policy: str) -> None:
        """Let a policy drive, for a person with this link, who has to be connected.

        Raises:
            NotAllowed: this role may not, nobody is connected with this link, or there is no such policy.
            NoSeat: another person holds the seat or asks for it.
            TooManyRequests: of this link.
        """
        mine = self._people_with(link)
        if by.role not in PEOPLE or not mine:
            raise NotAllowed("only people may offer the seat, with a connection that can take over")
        if policy and not self._is_policy(policy):
            raise NotAllowed("this is no policy")
        peer = next((each for each in mine if self.rules.holds(each.id)), mine[0])
        now = time.monotonic()
        if not peer.asks.take(now):
            raise TooManyRequests("too many offers with this link")
        self._act_for_link(self.rules.offer_to_policies(peer.id, peer.role, link, now, to=policy), peer)

    def withdraw_with(self, by: Actor) -> None:
        """End the offer, and the turn of the policy that drives, for a person. Raises NotAllowed."""
        outcome = self.rules.withdraw_offer("", by.role, time.monotonic())  # type: ignore[arg-type]
        self._act_for_link(outcome, by)

    def _people_with(self, link: str) -> list[Peer]:
        return [
            peer
            for peer in self._peers
            if peer.identity.token_id == link and peer.role in PEOPLE and peer.liveness.connected and not peer.ended
        ]

    def _act_for_link(self, outcome: SeatOutcome, actor: Peer | Actor) -> None:
        if outcome.refusal is not None:
            error = NoSeat if outcome.refusal.reason == "seat_taken" else NotAllowed
            raise error(outcome.refusal.detail)
        self._act(outcome, actor)

    def waits_for_nothing(self, peer: Peer, message: object) -> bool:
        """True if this is a person's press that takes the robot from a policy: it is never refused as too often.

        It follows an offer, and those are counted.
        """
        takes = (
            isinstance(message, SeatTake)
            or (isinstance(message, SeatRequest) and not message.only_if_free)
            or (isinstance(message, SeatOffer) and not message.offered)
        )
        return takes and self.rules.policy_drives and peer.role in PEOPLE

    def handle(self, peer: Peer, message: SeatMessage) -> None:
        """Act on a request of `peer`."""
        now = time.monotonic()
        match message:
            case SeatRequest(only_if_free=False) if self._asks_too_much(peer, now):
                self._host.refuse(peer, SeatRefusal(peer.id, "seat_taken", "your link has requested the seat already"))
            case SeatRequest(only_if_free=only_if_free):
                self._act(self.rules.request(peer.id, peer.role, now, only_if_free=only_if_free), peer)
            case SeatTake():
                self._act(self.rules.take(peer.id, peer.role, now), peer)
            case SeatGrant(peer=claimant):
                self._act(self.rules.answer(peer.id, claimant, now, grant=True), peer)
            case SeatDecline(peer=claimant):
                self._act(self.rules.answer(peer.id, claimant, now, grant=False), peer)
            case SeatOffer(offered=False):
                self._act(self.rules.withdraw_offer(peer.id, peer.role, now), peer)
            case SeatOffer(peer=policy) if policy and not self._is_policy(policy):
                self._host.refuse(peer, SeatRefusal(peer.id, "not_allowed", "this is no policy"))
            case SeatOffer(peer=policy):
                link = peer.identity.token_id
                self._act(self.rules.offer_to_policies(peer.id, peer.role, link, now, to=policy), peer)
            case SeatRelease():
                self._act(self.rules.release(peer.id, now), peer)

    def _asks_too_much(self, peer: Peer, now: float) -> bool:
        """True if this would be one claim too many of the link of `peer`."""
        if self.rules.standing(peer.id) is not Standing.OTHER:
            return False
        asking = [self._peers.by_id(each) for each in self.rules.claims(now)]
        link = peer.identity.token_id
        return sum(each is not None and each.identity.token_id == link for each in asking) >= LINK_CLAIMS

    def heard(self, peer: Peer) -> None:
        now, round_trip = time.monotonic(), (peer.media.round_trip_ms or 0.0) / 1000
        self.rules.heard(peer.id, now, round_trip)
        if peer.role in PEOPLE:
            self.rules.attended(peer.identity.token_id, now, round_trip)

    def moved(self, peer: Peer) -> None:
        """Called when a moving command of `peer` was forwarded."""
        self._act(self.rules.moved(peer.id, time.monotonic()), peer)

    def gone(self, peer: Peer) -> None:
        now = time.monotonic()
        self._act(self.rules.gone(peer.id, now), peer)
        link = peer.identity.token_id
        if not any(each.identity.token_id == link and each.role in PEOPLE and not each.ended for each in self._peers):
            self._act(self.rules.person_left(link, now), peer)

    def stopped(self) -> None:
        """Called when the robot is stopped: no policy moves it again before a person says so."""
        self._act(self.rules.end_offer(SeatInput.STOPPED, time.monotonic()), None)

    def link_lost(self) -> None:
        """Called when the link to the robot is lost: nobody knows what has changed there."""
        self._act(self.rules.end_offer(SeatInput.LINK_LOST, time.monotonic()), None)

    def _is_policy(self, peer_id: str) -> bool:
        peer = self._peers.by_id(peer_id)
        return peer is not None and peer.role == "policy"

    def renamed(self, peers: list[Peer]) -> None:
        """Tell everyone, if the seat's message names one of `peers`."""
        if any(self.rules.standing(peer.id) in (Standing.HOLDER, Standing.CLAIMANT) for peer in peers):
            self._publish(Actor())

    async def watch(self) -> None:
        """Act on time limits that run out, until cancelled."""
        while True:
            await asyncio.sleep(min(self.rules.times.heartbeat / CHECKS, 1.0))
            for outcome in self.rules.expire(time.monotonic()):
                self._act(outcome, None)

    def _act(self, outcome: SeatOutcome, actor: Peer | Actor | None) -> None:
        if outcome.rest:
            self._host.rest_robot(self.rules.why)
        if outcome.changed:
            self._publish(_actor(actor))
            for peer in self._peers:
                with peer.contained("media"):
                    peer.media.drives(self.rules.holds(peer.id))
        if outcome.refusal is not None:
            refused = self._peers.by_id(outcome.refusal.peer)
            if refused is not None:
                self._host.refuse(refused, outcome.refusal)

    def _publish(self, by: Actor) -> None:
        seat = self.message()
        self._events.publish(SeatChanged(seat, _actor(self._peers.by_id(seat.holder)), by))

    def _name(self, peer_id: str) -> str:
        peer = self._peers.by_id(peer_id) if peer_id else None
        return "" if peer is None else peer.name


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 1)


def _actor(who: Peer | Actor | None) -> Actor:
    return Actor() if who is None else who if isinstance(who, Actor) else who.actor
