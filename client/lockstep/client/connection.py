"""The connection to a console, from its opening to its end. `Console` is its public interface."""

import asyncio
import logging
from collections.abc import Callable
from contextlib import AsyncExitStack
from dataclasses import replace

from lockstep.client.connection_options import ConnectionOptions
from lockstep.client.control.driving import Driving
from lockstep.client.errors import ConnectFailed, ConsoleLost
from lockstep.client.heartbeat import Heartbeat
from lockstep.client.media.media_receiver import MediaReceiver
from lockstep.client.message_dispatcher import MessageDispatcher
from lockstep.client.requests.requests import Requests
from lockstep.client.session import Session
from lockstep.client.shielded_close import cancel_all, finish
from lockstep.client.statistics import ConsoleStatistics, percentiles
from lockstep.client.transport.open_transport import open_transport
from lockstep.client.transport.sfu_media import RelayMedia, RelayTicket
from lockstep.client.transport.transport import Transport
from lockstep.client.transport.whep import Whep
from lockstep.protocol.console import Rename

__all__ = ["Connection"]

_logger = logging.getLogger(__name__)


class Connection:
    """The connection to a console, from `open` to `close`. If it ends without `close`, `lost` has the reason and every
    wait raises it.

    Attributes:
        session: seat, participants, notes and STOP
        driving: the robot
        media: pictures and sound
        news: of the robot's actions, status and place
        relay: the source of the media; None: the console
    """

    def __init__(self, options: ConnectionOptions) -> None:
        self.options = options
        self.session = Session()
        self.driving = Driving(options, self.session, lambda message: self.transport.send("control", message))
        self.media = MediaReceiver(options.tolerance, options.gate, self.driving.rendered, self.driving.heard)
        self.relay: RelayMedia | None = None
        self._heartbeat = Heartbeat(self.session, self.driving, options.silence_seconds)
        self._messages = MessageDispatcher(self.session, self.driving, self.media, self._heartbeat)
        self.news = self._messages.news
        self._loop = asyncio.get_running_loop()
        self._has_media = asyncio.Event()  # `media` is prepared
        self._transport: Transport | None = None
        self._requests: Requests | None = None
        self._running: asyncio.Task[None] | None = None

    @property
    def transport(self) -> Transport:
        if self._transport is None:
            raise ConsoleLost("not connected yet")
        return self._transport

    @property
    def requests(self) -> Requests:
        if self._requests is None:
            raise ConsoleLost("not connected yet")
        return self._requests

    @property
    def lost(self) -> ConsoleLost | None:
        return self._messages.lost

    async def open(self) -> None:
        """Connect and wait until the robot is known. Raises SignallingRefused or ConnectFailed."""
        deadline = self._loop.time() + self.options.connect_seconds
        ticket = None
        if self.options.through_relay:
            async with Whep(self.options.link, self.options.tls_ca) as whep:
                ticket = await whep.relay()
        transport = await self._connect(ticket, deadline)
        # No group of the caller: the end of a connection must not cancel the program, whose waits raise it.
        self._running = self._loop.create_task(self._run(transport), name="console connection")
        if ticket is not None:
            await self._watch_through_relay(transport, deadline)
        self._has_media.set()
        transport.send("session", Rename(name=self.options.name))
        await self._until(
            lambda: self.session.role is not None and self.driving.known.is_set(),
            deadline,
            "did not describe its robot",
        )

    async def _connect(self, ticket: RelayTicket | None, deadline: float) -> Transport:
        """Connect, for all but media and feedback if those come from a relay."""
        options, beside = self.options, ""
        if ticket is not None:
            options, beside = replace(options, video=0, audio=False, carrier="trailer"), ticket.relay
        transport, sections = await open_transport(options, self._messages.received, deadline, beside=beside)
        self._transport = transport
        self._requests = Requests.over(transport, self.session, self.driving, self._messages)
        if ticket is None and transport.packets is not None:
            self.media.prepare(transport.packets, sections, options.decode)
        await transport.connect(deadline - self._loop.time())
        return transport

    async def _watch_through_relay(self, transport: Transport, deadline: float) -> None:
        """Subscribe at the relay once connected: the console gives the relay's key only to a connected observer."""
        await self._until(lambda: self.session.role is not None, deadline, "said nothing")
        ticket = await transport.whep.relay(self.session.peer)
        if ticket is None:
            raise ConnectFailed("no relay carries the session now")
        relay = self.relay = RelayMedia(ticket, self._messages.received_from_relay)
        wanted = {"video": self.options.video, "audio": int(self.options.audio)}
        first = [each for kind in wanted for each in [s for s in ticket.streams if s.kind == kind][: wanted[kind]]]
        sections = await relay.negotiate(lambda stream: stream in first)
        if relay.packets is not None:
            self.media.prepare(relay.packets, sections, self.options.decode)
        await relay.connect()

    async def _until(self, condition: Callable[[], bool], deadline: float, missing: str) -> None:
        """Wait for a message of the opening. Raises ConnectFailed with `missing` after the deadline."""
        try:
            async with asyncio.timeout_at(deadline):
                await self._messages.until(condition)
        except TimeoutError:
            raise ConnectFailed(f"connected, but the console {missing}") from None
        except ConsoleLost as error:
            raise ConnectFailed(error.detail) from error

    async def _run(self, transport: Transport) -> None:
        """Run until the connection ends or is closed."""
        try:
            async with asyncio.TaskGroup() as group:
                tasks = [group.create_task(transport.run())]
                tasks.append(group.create_task(self._start_session(transport, group, tasks)))
                await transport.ended.wait()
                await cancel_all(tasks)
        except Exception as error:  # a fault of this program; the user's waits raise it
            _logger.exception("the connection to the console failed")
            cause = error.exceptions[0] if isinstance(error, ExceptionGroup) else error
            transport.lose(f"this client failed: {type(cause).__name__}: {cause}")
        finally:
            self._end(ConsoleLost(transport.why or "closed"))

    async def _start_session(
        self, transport: Transport, group: asyncio.TaskGroup, tasks: list[asyncio.Task[None]]
    ) -> None:
        """Start the media and the heartbeat once the media are known; add their tasks to `tasks`."""
        await self._has_media.wait()
        work = [self.media.run(), self._heartbeat.run(transport, self.media, relayed=self.relay is not None)]
        if self.relay is not None:
            work += [self.relay.run(), self._end_with(self.relay, transport)]
        tasks += [group.create_task(each) for each in work]

    async def _end_with(self, relay: RelayMedia, transport: Transport) -> None:
        await relay.ended.wait()
        transport.lose(relay.why)

    def _end(self, lost: ConsoleLost) -> None:
        if self.lost is None:
            self.driving.end(lost)
            self.media.end()
            self._messages.end(lost)

    async def close(self) -> None:
        """End everything, even if cancelled meanwhile. Idempotent."""
        await finish(self._close())

    async def _close(self) -> None:
        async with AsyncExitStack() as stack:  # each is closed, whatever the others raise
            stack.callback(self.media.close)
            stack.callback(self._end, ConsoleLost("closed"))
            if self._running is not None:
                stack.push_async_callback(asyncio.wait, [self._running])
            if self.relay is not None:
                stack.push_async_callback(self.relay.close)
            if self._transport is not None:
                stack.push_async_callback(self._transport.close)

    def statistics(self) -> ConsoleStatistics:
        driver, round_trip = self.driving.driver, self._heartbeat.round_trip
        sender, delays, now = driver.sender, driver.picture_delay.samples, self._loop.time()
        delay = percentiles(delays, 1000)
        return ConsoleStatistics(
            peer=self.session.peer,
            epoch=self.driving.robot.epoch,
            event=sender.newest.event if sender.newest is not None else 0,
            armed=sender.armed,
            gate=sender.gate.state(now),
            streams=self.media.statistics(),
            picture_delay_ms=delays[-1] * 1000 if delays else None,
            picture_delay_p50_ms=delay.median,
            picture_delay_p95_ms=delay.p95,
            command_to_picture_ms=delay,
            round_trip_ms=round_trip * 1000 if round_trip is not None else None,
            command_to_feedback_ms=percentiles(sender.retransmission.samples, 1000),
            event_rate=self.driving.event_rate.rate(now),
            bad_messages=self._messages.malformed,
            repeats=sender.retransmission.repeats,
            echoes=sender.retransmission.echoes,
        )
