"""The rules of the control seat: which peer may ask for what, and what ends with time. No I/O, no clock.

They come before the table (`seat_table.py`):

A role that may not drive is refused `not_allowed`; so is the take of an operator while another person holds the seat; a
grant or decline by another than the holder is refused `no_seat`; a claim too many, or soon after a decline, is refused.

A policy is seated only in a free seat that a person has offered (`policies/seat_offer.py`); it never claims, takes or
answers. Every person's request takes the seat from it at once.
"""

from collections.abc import Iterator

from lockstep.protocol.console import PEOPLE, Role
from lockstep.server.control.policies.seat_offer import Offer
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_table import NOTHING, SeatInput, SeatOutcome, SeatRefusal, Standing
from lockstep.server.control.seat.seat_times import Heartbeat

__all__ = ["SeatRules"]


class SeatRules:
    """Takes the inputs of a seat. Act on each outcome.

    Call `heard` for every valid message of a peer, `attended` for one of a person, `moved` for every moving command of
    the holder that passed, and `expire` a few times a second.
    """

    def __init__(self, seat: ControlSeat) -> None:
        self.seat = seat
        self._attendance = Heartbeat(seat.times.heartbeat)  # of the person who made the offer

    # requests of peers

    def request(self, peer: str, role: Role, now: float, *, only_if_free: bool = False) -> SeatOutcome:
        if role == "policy":
            return self._request_by_policy(peer, now)
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "this link watches; an operator's link drives"))
        what = SeatInput.REQUEST_IF_FREE if only_if_free else SeatInput.REQUEST
        if what is SeatInput.REQUEST and self.seat.standing(peer) is Standing.POLICY:
            what = SeatInput.TAKE
        return self.seat.step(peer, what, now, role)

    def _request_by_policy(self, peer: str, now: float) -> SeatOutcome:
        """Seat a policy if a person lets it; it waits for no seat."""
        match self.seat.standing(peer):
            case Standing.FREE if self.seat.offer is not None and self.seat.offer.admits(peer):
                return self.seat.step(peer, SeatInput.REQUEST, now, "policy")
            case Standing.FREE:
                return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "no person offers the seat to this policy"))
            case Standing.HOLDER:
                return NOTHING  # asking is no sign that it drives
            case _:
                return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken"))

    def take(self, peer: str, role: Role, now: float) -> SeatOutcome:
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "only people may take the seat"))
        if role != "supervisor" and self.seat.standing(peer) in (Standing.CLAIMANT, Standing.OTHER):
            detail = "only a supervisor may take the seat from another person"
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", detail))
        return self.seat.step(peer, SeatInput.TAKE, now, role)

    def answer(self, peer: str, claimant: str, now: float, *, grant: bool) -> SeatOutcome:
        """Take the answer of `peer` to the claim of `claimant`; ignore it if there is no such claim any more."""
        if not self.seat.holds(peer):
            return SeatOutcome(refusal=SeatRefusal(peer, "no_seat", "only the holder of the seat may answer"))
        return self.seat.step(claimant, SeatInput.GRANTED if grant else SeatInput.DECLINED, now)

    def release(self, peer: str, now: float) -> SeatOutcome:
        return self.seat.step(peer, SeatInput.RELEASE, now)

    # the offer to policies

    def offer_to_policies(self, peer: str, role: Role, link: str, now: float, *, to: str = "") -> SeatOutcome:
        """Let a policy drive. `link`: of `peer`, which is responsible; `to`: the only policy, "": any."""
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "only people may offer the seat"))
        if self.seat.holder and not self.seat.policy_drives and not self.seat.holds(peer):
            return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken", "its holder may offer it"))
        if self.seat.claims:
            return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken", "somebody asks for the seat; answer first"))
        outcome = self.seat.step(peer, SeatInput.OFFERED, now)
        self.seat.offer = Offer(peer, link, self.seat.holder or to, now + self.seat.times.claim)
        self._attendance.heard(now)
        return outcome._replace(changed=True)

    def withdraw_offer(self, peer: str, role: Role, now: float) -> SeatOutcome:
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "only people may withdraw the offer"))
        return self.end_offer(SeatInput.WITHDRAWN, now)

    def end_offer(self, what: SeatInput, now: float) -> SeatOutcome:
        """End the offer and the turn of the policy that drives. `what`: one of OFFER_ENDS."""
        if self.seat.offer is None:
            return NOTHING
        self.seat.offer = None
        if self.seat.policy_drives:
            return self.seat.step(self.seat.holder, what, now)
        return SeatOutcome(changed=True)

    def attended(self, link: str, now: float, round_trip: float = 0.0) -> None:
        """Called for each message of a person. `link`: that person's; `round_trip`: s, as in `heard`."""
        if self.seat.offer is not None and self.seat.offer.link == link:
            self._attendance.heard(now, round_trip)

    def person_left(self, link: str, now: float) -> SeatOutcome:
        """Called when the last connection of a link has ended with which a person takes part."""
        if self.seat.offer is None or self.seat.offer.link != link:
            return NOTHING
        return self.end_offer(SeatInput.UNATTENDED, now)

    # observations of peers

    def gone(self, peer: str, now: float) -> SeatOutcome:
        self.seat.claims.gone(peer)
        return self.seat.step(peer, SeatInput.GONE, now)

    def heard(self, peer: str, now: float, round_trip: float = 0.0) -> None:
        """Called for each message of `peer`. `round_trip`: s, as measured last; 0 before the first measurement."""
        if self.seat.holds(peer):
            self.seat.heartbeat.heard(now, round_trip)

    def moved(self, peer: str, now: float) -> SeatOutcome:
        """Restart the idle time of the holder, and end a countdown."""
        return SeatOutcome(changed=self.seat.idle.restart(now)) if self.seat.holds(peer) else NOTHING

    def expire(self, now: float) -> Iterator[SeatOutcome]:
        """Yield an outcome for each time limit that has run out; act on each before the next."""
        seat = self.seat
        if seat.offer is not None and self._attendance.is_lost(now):
            yield self.end_offer(SeatInput.UNATTENDED, now)
        if seat.holder and seat.heartbeat.is_lost(now):
            yield seat.step(seat.holder, SeatInput.SILENT, now)
        if seat.holder and seat.idle.is_over(now):
            yield seat.step(seat.holder, SeatInput.IDLE, now)
        for peer in seat.claims.unanswered(now):
            yield seat.step(peer, SeatInput.UNANSWERED, now)
        if seat.offer is not None and not seat.holder and now >= seat.offer.until:
            yield self.end_offer(SeatInput.WITHDRAWN, now)
        if seat.holder and seat.idle.begins_countdown(now):
            yield SeatOutcome(changed=True)
