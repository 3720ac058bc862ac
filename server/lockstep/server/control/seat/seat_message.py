"""The message that tells everyone the state of the control seat."""

from lockstep.protocol.console import Seat, SeatClaim, driver_kind
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.peers.peer_registry import PeerRegistry

__all__ = ["seat_message"]


def seat_message(seat: ControlSeat, peers: PeerRegistry, now: float) -> Seat:
    """Return the seat's state as everyone is told it. `now`: monotonic seconds."""
    offer, idle = seat.offer, seat.idle.seconds_left(now)
    holder = peers.by_id(seat.holder) if seat.holder else None
    return Seat(
        holder=seat.holder,
        name="" if holder is None else holder.name,
        kind="none" if holder is None else driver_kind(holder.role),
        offered=offer is not None,
        offered_to="" if offer is None else offer.to,
        offered_by="" if offer is None else _name(peers, offer.by),
        why=seat.why,
        claims=[
            SeatClaim(peer=peer, name=_name(peers, peer), seconds_left=round(left, 1))
            for peer, left in seat.claims.seconds_left(now).items()
        ],
        idle_seconds_left=None if idle is None else round(idle, 1),
    )


def _name(peers: PeerRegistry, peer_id: str) -> str:
    peer = peers.by_id(peer_id) if peer_id else None
    return "" if peer is None else peer.name
