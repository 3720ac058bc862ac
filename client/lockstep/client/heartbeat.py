"""Reports to the console and pings it: measures the path, and notices losses and silence."""

import asyncio

from lockstep.client.control.driving import Driving
from lockstep.client.media.media_receiver import MediaReceiver
from lockstep.client.session import Session
from lockstep.client.transport.ping_ledger import PingLedger
from lockstep.client.transport.transport import Transport
from lockstep.protocol.console import Report
from lockstep.protocol.messages import Ping, Pong

__all__ = ["Heartbeat"]

INTERVAL = 0.5  # s between two reports, and between two pings
OBSERVER_INTERVAL = 1.0  # s, for a peer that cannot drive; there may be hundreds
RELAYED_INTERVAL = 5.0  # s, for an observer behind a relay, whose answers delay no command
RELIABLE_INTERVAL = 15.0  # s, for one whose messages are never lost
EARLY_PINGS = 5  # pings that measure the path before the first command
EARLY_PING = 0.05  # s between them


class Heartbeat:
    """The heartbeat of a connection. Call `heard` with every message, and `pong` with every answer to a ping."""

    def __init__(self, session: Session, driving: Driving, silence_seconds: float) -> None:
        """`silence_seconds`: time without a message after which the connection counts as lost."""
        self._session = session
        self._driving = driving
        self._silence_seconds = silence_seconds
        self._pings = PingLedger()
        self._loop = asyncio.get_running_loop()
        self._heard_at = self._loop.time()

    @property
    def round_trip(self) -> float | None:
        """The round trip of the last answered ping, in s; None before the first."""
        return self._pings.round_trip

    def heard(self) -> None:
        """Note that a message came from the console."""
        self._heard_at = self._loop.time()

    def pong(self, pong: Pong) -> float | None:
        """Return the round trip of the ping that this answers, in s; None if it answers none."""
        return self._pings.answered(pong.id, self._loop.time())

    async def run(self, transport: Transport, media: MediaReceiver, *, relayed: bool) -> None:
        """Send pings first, and reports once the path is measured, until cancelled.

        `relayed`: media and feedback come from a relay.
        """
        self.heard()
        await self._driving.known.wait()
        early_pings = EARLY_PINGS
        while True:
            now = self._loop.time()
            if now - self._heard_at > self._silence_seconds:
                transport.lose(f"nothing was heard from the console for {self._silence_seconds:g} s")
            if self._pings.lost(now):
                self._driving.driver.loss()
            ping = self._pings.send(now)
            if early_pings:
                early_pings -= 1
                transport.send("control", Ping(id=ping))
                await asyncio.sleep(EARLY_PING)
                continue
            transport.send("control", self._report(media, ping))
            media.reported()
            await asyncio.sleep(self._interval(transport, relayed))

    def _interval(self, transport: Transport, relayed: bool) -> float:
        if relayed:
            return RELIABLE_INTERVAL if transport.reliable else RELAYED_INTERVAL
        return OBSERVER_INTERVAL if self._session.is_observer else INTERVAL

    def _report(self, media: MediaReceiver, ping: int) -> Report:
        driver = self._driving.driver
        delay = driver.picture_delay.known(self._loop.time())
        return Report(
            event=driver.sender.newest.event if driver.sender.newest is not None else 0,
            armed=driver.sender.armed,
            streams=[stream.report() for stream in media.statistics()],
            picture_delay_ms=delay * 1000 if delay is not None else None,
            round_trip_ms=self.round_trip * 1000 if self.round_trip is not None else None,
            ping=ping,
        )
