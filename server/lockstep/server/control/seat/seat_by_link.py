"""Requests for the control seat over HTTP, which carry a link and no peer."""

import time

from lockstep.protocol.console import PEOPLE
from lockstep.server.audit.records import Actor
from lockstep.server.control.seat.seat_keeper import SeatKeeper, is_policy
from lockstep.server.control.seat.seat_table import SeatOutcome
from lockstep.server.errors import NoSeat, NotAllowed, TooManyRequests
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry

__all__ = ["SeatByLink"]


class SeatByLink:
    """Finds the peer of each request's link. Every method is called on the loop and returns at once."""

    def __init__(self, keeper: SeatKeeper, peers: PeerRegistry) -> None:
        self._keeper = keeper
        self._peers = peers

    def take(self, link: str, by: Actor) -> None:
        """End the turn of the policy that drives, for a person with this link. No I/O waits before the robot rests.

        The person's connection gets the seat, if exactly one has this link; else the seat is free.

        Raises:
            NotAllowed: this role may not, or another person holds the seat.
        """
        now, mine = time.monotonic(), self._people_with(link)
        if len(mine) == 1:
            outcome = self._keeper.rules.take(mine[0].id, mine[0].role, now)
        else:
            outcome = self._keeper.rules.withdraw_offer("", by.role, now)  # type: ignore[arg-type]
        self._act(outcome, mine[0] if len(mine) == 1 else by)

    def offer(self, link: str, by: Actor, *, policy: str) -> None:
        """Let a policy drive, for a person with this link, who has to be connected.

        Raises:
            NotAllowed: this role may not, nobody is connected with this link, or there is no such policy.
            NoSeat: another person holds the seat or asks for it.
            TooManyRequests: of this link.
        """
        mine = self._people_with(link)
        if by.role not in PEOPLE or not mine:
            raise NotAllowed("only people may offer the seat, with a connection that can take over")
        if policy and not is_policy(self._peers.by_id(policy)):
            raise NotAllowed("this is no policy")
        peer = next((each for each in mine if self._keeper.is_held_by(each)), mine[0])
        now = time.monotonic()
        if not peer.asks.take(now):
            raise TooManyRequests("too many offers with this link")
        self._act(self._keeper.rules.offer_to_policies(peer.id, peer.role, link, now, to=policy), peer)

    def withdraw(self, by: Actor) -> None:
        """End the offer, and the turn of the policy that drives, for a person. Raises NotAllowed."""
        outcome = self._keeper.rules.withdraw_offer("", by.role, time.monotonic())  # type: ignore[arg-type]
        self._act(outcome, by)

    def _people_with(self, link: str) -> list[Peer]:
        return [
            peer
            for peer in self._peers
            if peer.identity.token_id == link and peer.role in PEOPLE and peer.liveness.connected and not peer.ended
        ]

    def _act(self, outcome: SeatOutcome, actor: Peer | Actor) -> None:
        if outcome.refusal is not None:
            error = NoSeat if outcome.refusal.reason == "seat_taken" else NotAllowed
            raise error(outcome.refusal.detail)
        self._keeper.act(outcome, actor)
