"""STOP and its reset: the presses of a connection and their confirmation."""

import asyncio
import secrets

from msgspec.structs import replace

from lockstep.client.control.driving import Driving
from lockstep.client.errors import CommandRefused, ConsoleError, ConsoleLost, StopUnconfirmed
from lockstep.client.requests.exchange import ANSWER_SECONDS, Exchange, Until
from lockstep.client.session import Session
from lockstep.client.transport.transport import Transport
from lockstep.protocol.messages import Reset, Stop, StopState

__all__ = ["StopRequests"]

RESET_AGAIN = 0.5  # s between two tries while the stop is too new, or the robot's answer to a press is on its way
STOP_SECONDS = 0.3  # time for a channel to confirm a stop, before HTTP is tried as well or after HTTP has failed


class StopRequests:
    """Latches the stop, and releases it."""

    def __init__(
        self, transport: Transport, session: Session, driving: Driving, exchange: Exchange, until: Until
    ) -> None:
        self._transport = transport
        self._session = session
        self._driving = driving
        self._exchange = exchange
        self._until = until

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

    async def reset(self, by: str, number: int) -> StopState:
        """Release stop `number`, and no later one. Raises CommandRefused.

        Waits while it is too soon, and while the console waits for the robot's answer to a press: feedback may have
        shown the stop already.
        """
        reset = Reset(by=by, number=number)
        loop = asyncio.get_running_loop()
        until = loop.time() + ANSWER_SECONDS
        while True:
            refusal = await self._exchange.ask(lambda: self._is_released(number), "stop", reset)
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
