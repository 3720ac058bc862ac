"""The requests of a connection that the console or the robot answers: seat, notes, STOP and reset."""

import asyncio
import secrets
from collections.abc import Awaitable, Callable

from msgspec.structs import replace

from lockstep.client.control.driving import Driving
from lockstep.client.errors import CommandRefused, ConsoleError, ConsoleLost, SeatRefused, StopUnconfirmed
from lockstep.client.session import Session
from lockstep.client.transport.transport import ChannelName, Transport
from lockstep.protocol.console import (
    ClientMessage,
    Note,
    SeatDecline,
    SeatGrant,
    SeatOffer,
    SeatRelease,
    SeatRequest,
    SeatTake,
    SharedNote,
)
from lockstep.protocol.messages import Refusal, Reset, Stop, StopState
from lockstep.protocol.traces.trace_messages import TraceRequest

__all__ = ["SessionRequests"]

RESET_AGAIN = 0.5  # s between two tries while the stop is too new, or the robot's answer to a press is on its way
ANSWER_SECONDS = 5.0  # time for the console to answer a request
STOP_SECONDS = 0.3  # time for a channel to confirm a stop, before HTTP is tried as well or after HTTP has failed


class SessionRequests:
    """Sends requests, and waits until a message has changed the session as asked or refuses it."""

    def __init__(
        self,
        transport: Transport,
        session: Session,
        driving: Driving,
        until: Callable[[Callable[[], bool]], Awaitable[None]],
    ) -> None:
        """`until`: waits until a message makes a condition true."""
        self._transport = transport
        self._session = session
        self._driving = driving
        self._until = until

    async def take_seat(self) -> None:
        """Take the control seat. Raises SeatRefused."""
        takes = self._session.role == "supervisor"
        await self._seat(SeatTake() if takes else SeatRequest(only_if_free=True), ANSWER_SECONDS)

    async def request_seat(self, seconds: float) -> None:
        """Ask for the control seat; withdraw the request unless granted. Raises SeatRefused, also after `seconds`."""
        try:
            await self._seat(SeatRequest(), seconds)
        except ConsoleLost:
            if not self._session.claims_seat:
                raise
            raise SeatRefused("declined", f"no answer within {seconds:g} s") from None
        finally:
            if not self._session.holds_seat:
                self.release_seat()

    async def take_over(self) -> None:
        """Take the control seat from a policy, or a free one. Raises SeatRefused."""
        await self._seat(SeatTake(), ANSWER_SECONDS)

    async def offer(self, policy: str) -> None:
        """Offer the seat to a policy; "": to any. Raises SeatRefused."""
        before = self._session.seat  # another person's offer may hold already; the console tells of each new one

        def is_new() -> bool:
            return self._session.seat is not before and self._session.seat.offered

        refusal = await self._ask(is_new, "session", SeatOffer(peer=policy), ANSWER_SECONDS)
        if refusal is not None:
            raise SeatRefused(refusal.reason, refusal.detail)

    def withdraw_offer(self) -> None:
        self._transport.send("session", SeatOffer(offered=False))

    async def offered_here(self) -> None:
        """Wait until the free seat is offered to this connection."""
        await self._until(self._is_offered_here)

    def _is_offered_here(self) -> bool:
        seat = self._session.seat
        return seat.offered and not seat.holder and seat.offered_to in ("", self._session.peer)

    def release_seat(self) -> None:
        self._transport.send("session", SeatRelease())

    def answer(self, peer: str, *, grant: bool) -> None:
        self._transport.send("session", SeatGrant(peer=peer) if grant else SeatDecline(peer=peer))

    def trace(self, *, wanted: bool) -> None:
        self._transport.send("session", TraceRequest(wanted=wanted))

    async def note(self, text: str) -> SharedNote:
        """Write a note and return it. Raises CommandRefused: too many notes, or nothing in this one can be printed."""
        newest = self._session.notes[-1].id if self._session.notes else 0

        def mine() -> SharedNote | None:
            return next(
                (note for note in self._session.notes if note.id > newest and note.peer == self._session.peer), None
            )

        refusal = await self._ask(lambda: mine() is not None, "session", Note(text=text), ANSWER_SECONDS)
        note = mine()
        if note is None:
            raise CommandRefused(*(("declined", "") if refusal is None else (refusal.reason, refusal.detail)))
        return note

    async def reset(self, by: str, number: int) -> StopState:
        """Release stop `number`, and no later one. Raises CommandRefused.

        Waits while it is too soon, and while the console waits for the robot's answer to a press: feedback may have
        shown the stop already.
        """
        reset = Reset(by=by, number=number)
        loop = asyncio.get_running_loop()
        until = loop.time() + ANSWER_SECONDS
        while True:
            refusal = await self._ask(lambda: self._is_released(number), "stop", reset, ANSWER_SECONDS)
            if refusal is None:
                return self._session.stop_state
            passes = refusal.reason == "too_soon" or (
                refusal.reason == "stale_reset" and self._session.newest_stop <= number
            )
            if not passes or loop.time() > until:
                raise CommandRefused(refusal.reason, refusal.detail)
            await asyncio.sleep(RESET_AGAIN)

    def _is_released(self, number: int) -> bool:
        return not self._session.stop_state.stopped and self._session.stop_state.number == number

    async def _seat(self, message: SeatRequest | SeatTake, seconds: float) -> None:
        refusal = await self._ask(lambda: self._session.holds_seat, "session", message, seconds)
        if refusal is not None:
            raise SeatRefused(
                refusal.reason,
                refusal.detail or (f"{self._session.seat.name} holds it" if self._session.seat.name else ""),
            )

    async def _ask(
        self, granted: Callable[[], bool], channel: ChannelName, message: ClientMessage, seconds: float
    ) -> Refusal | None:
        """Send a request; return None if it was granted, otherwise the refusal."""
        self._session.refusals.clear()
        self._transport.send(channel, message)
        try:
            async with asyncio.timeout(seconds):
                await self._until(lambda: granted() or bool(self._session.refusals))
        except TimeoutError:
            raise ConsoleLost(f"no answer from the console within {seconds:g} s") from None
        return None if granted() else self._session.refusals.popleft()

    async def stop(self, by: str, reason: str) -> StopState:
        """Latch the stop. Raises StopUnconfirmed if neither the data channel nor HTTP brought the robot's answer."""
        press = secrets.token_hex(16)
        self._transport.send("stop", Stop(by=by, reason=reason, press=press))
        # An observer's message on a channel may wait behind those of a crowd; a stop by HTTP waits for no other
        # request.
        if self._session.is_observer or not await self._is_confirmed_soon(press):
            await self._stop_by_http(reason, press)
        self._driving.stopped()
        confirmed = self._session.confirmed(press)
        if confirmed is None:
            raise StopUnconfirmed(press, "the stop was not confirmed")
        return replace(confirmed, by=confirmed.by or by, reason=confirmed.reason or reason)

    async def _is_confirmed_soon(self, press: str) -> bool:
        try:
            async with asyncio.timeout(STOP_SECONDS):
                await self._until(lambda: self._session.confirmed(press) is not None)
        except (TimeoutError, ConsoleLost):
            return False
        return True

    async def _stop_by_http(self, reason: str, press: str) -> None:
        try:
            self._session.stop_taken(await self._transport.whep.stop(reason, press))
        except ConsoleError as error:
            if not await self._is_confirmed_soon(press):  # by the channel
                raise StopUnconfirmed(press, f"the stop was not confirmed: {error}") from error
