"""Requests for the control seat, and what follows a new one."""

import asyncio
from contextlib import suppress

from lockstep.client.control.driving import Driving
from lockstep.client.errors import CommandRefused, ConsoleLost, NoFeedback, SeatRefused
from lockstep.client.requests.exchange import ANSWER_SECONDS, Exchange, Until
from lockstep.client.session import Session
from lockstep.client.transport.transport import Transport
from lockstep.protocol.console import SeatDecline, SeatGrant, SeatOffer, SeatRelease, SeatRequest, SeatTake

__all__ = ["SeatRequests"]

FEEDBACK_SECONDS = 5.0  # time for the first feedback to arrive


class SeatRequests:
    """Takes, offers and releases the control seat."""

    def __init__(
        self, transport: Transport, session: Session, driving: Driving, exchange: Exchange, until: Until
    ) -> None:
        self._transport = transport
        self._session = session
        self._driving = driving
        self._exchange = exchange
        self._until = until

    async def take(self) -> None:
        """Take the control seat. Raises SeatRefused."""
        takes = self._session.role == "supervisor"
        await self._claim(SeatTake() if takes else SeatRequest(only_if_free=True), ANSWER_SECONDS)

    async def take_over(self) -> None:
        """Take the control seat from a policy, or a free one. Raises SeatRefused."""
        await self._claim(SeatTake(), ANSWER_SECONDS)

    async def request(self, seconds: float) -> None:
        """Ask for the control seat; withdraw the request unless granted. Raises SeatRefused, also after `seconds`."""
        try:
            await self._claim(SeatRequest(), seconds)
        except ConsoleLost:
            if not self._session.claims_seat:
                raise
            raise SeatRefused("declined", f"no answer within {seconds:g} s") from None
        finally:
            if not self._session.holds_seat:
                self.release()

    async def _claim(self, message: SeatRequest | SeatTake, seconds: float) -> None:
        refusal = await self._exchange.ask(lambda: self._session.holds_seat, "session", message, seconds)
        if refusal is not None:
            holder = self._session.seat.name
            raise SeatRefused(refusal.reason, refusal.detail or (f"{holder} holds it" if holder else ""))

    async def arm_if_possible(self) -> None:
        """Arm, unless the robot is stopped or away. Raises NoFeedback if no feedback of a robot that is there came."""
        driving = self._driving
        sender = driving.driver.sender
        try:
            async with asyncio.timeout(FEEDBACK_SECONDS):
                await self._until(lambda: sender.newest is not None or driving.robot.link == "down")
        except TimeoutError:
            raise NoFeedback(f"no feedback came from the robot within {FEEDBACK_SECONDS:g} s") from None
        if driving.robot.link == "down" or sender.newest is None or sender.newest.stop.stopped:
            return
        with suppress(CommandRefused):
            await driving.driver.arm()

    async def offer(self, policy: str) -> None:
        """Offer the seat to a policy; "": to any. Raises SeatRefused."""
        before = self._session.seat  # another person's offer may hold already; the console tells of each new one

        def is_new() -> bool:
            return self._session.seat is not before and self._session.seat.offered

        refusal = await self._exchange.ask(is_new, "session", SeatOffer(peer=policy))
        if refusal is not None:
            raise SeatRefused(refusal.reason, refusal.detail)

    def withdraw_offer(self) -> None:
        self._transport.send("session", SeatOffer(offered=False))

    async def offered_here(self) -> None:
        """Wait until the free seat is offered to this connection."""

        def is_offered_here() -> bool:
            seat = self._session.seat
            return seat.offered and not seat.holder and seat.offered_to in ("", self._session.peer)

        await self._until(is_offered_here)

    def release(self) -> None:
        """Release the seat, or withdraw a request for it."""
        self._transport.send("session", SeatRelease())

    def answer(self, peer: str, *, grant: bool) -> None:
        """Answer the request of a peer for the seat."""
        self._transport.send("session", SeatGrant(peer=peer) if grant else SeatDecline(peer=peer))
