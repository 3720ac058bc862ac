"""The connection to a console: messages in and out, seat, stop, heartbeat. `Console` is its public interface."""

import asyncio
import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from msgspec.structs import replace as replace_struct

from lockstep.client.console_url import ConsoleLink
from lockstep.client.control.command_gate import CommandGate, Pacing
from lockstep.client.control.command_sender import CommandSender
from lockstep.client.control.sender_task import Driver
from lockstep.client.errors import ConnectFailed, ConsoleError, ConsoleLost, SignallingRefused, StopUnconfirmed
from lockstep.client.media.media_gate import GateMode
from lockstep.client.media.media_receiver import MediaReceiver
from lockstep.client.media.newest_queue import NewestQueue
from lockstep.client.media.render_log import LIMIT, FeedbackArrival
from lockstep.client.session import Session
from lockstep.client.shielded_close import cancel_all, finish
from lockstep.client.statistics import ConsoleStatistics, EventRate, percentiles
from lockstep.client.transport.observer_websocket import LineBlocked, ObserverWebSocket
from lockstep.client.transport.ping_ledger import PingLedger
from lockstep.client.transport.sdp import Section
from lockstep.client.transport.sfu_media import RelayMedia, RelayTicket
from lockstep.client.transport.webrtc_peer import Peer, Route
from lockstep.protocol.carriers import Carrier
from lockstep.protocol.console import (
    Participants,
    Rename,
    Report,
    RobotState,
    Seat,
    SharedNote,
    StopStateNotice,
    Welcome,
    decode_server_message,
)
from lockstep.protocol.errors import MessageError
from lockstep.protocol.messages import Feedback, Ping, Pong, Refusal, Stop, StopState, StopTaken

__all__ = ["Connection", "ConnectionOptions"]

HEARTBEAT = 0.5  # s between two reports, and between two pings
OBSERVER_HEARTBEAT = 1.0  # s, for a peer that cannot drive; there may be hundreds
RELAYED_HEARTBEAT = 5.0  # s, for an observer, whose answers delay no command
LINE_HEARTBEAT = 15.0  # s, for an observer on a WebSocket, which loses nothing
EARLY_PINGS = 5  # pings that measure the path before the first command
EARLY_PING = 0.05  # s between them
STOP_SECONDS = 0.3  # time for a channel to confirm a stop, before HTTP is tried as well or after HTTP has failed
RETRY_SECONDS = 1.0  # between two tries while the console does not reach its robot; as in its Retry-After


@dataclass(frozen=True)
class ConnectionOptions:
    """The arguments of `Console`."""

    link: ConsoleLink
    pacing: Pacing
    tolerance: dict[str, int]  # by kind of medium
    gate: GateMode
    carrier: Carrier
    video: int
    audio: bool
    decode: bool
    codec: str | None
    sound_codec: str | None
    event_rate: float | None
    name: str
    connect_seconds: float
    silence_seconds: float
    route: Route | None
    tls_ca: Path | None = None
    relay_only: bool = False
    through_relay: bool = False


class Connection:
    """The connection to a console, from `open` to `close`. If it ends without `close`, `lost` has the reason and every
    wait raises it."""

    def __init__(self, options: ConnectionOptions) -> None:
        self.options = options
        self.lost: ConsoleLost | None = None
        self.malformed = 0  # messages from the console that could not be read
        self.feedback_readers: list[NewestQueue[Feedback]] = []
        self.feedback_log: deque[FeedbackArrival] = deque(maxlen=LIMIT)
        self.media = MediaReceiver(options.carrier, options.tolerance, options.gate, self._rendered)
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()  # a message came, or the connection ended
        self._robot: RobotState | None = None
        self._driver: Driver | None = None
        self._early_feedback: Feedback | None = None  # arrived before the robot's description
        self._event_rate = EventRate()
        self._pings = PingLedger()
        self._heard_at = self._loop.time()
        self._running: asyncio.Task[None] | None = None
        self._relay: RelayMedia | None = None
        self._beside = ""  # the relay that the console sent this observer to
        self._peer: Peer | ObserverWebSocket = self._new_peer()
        self.session = Session(lambda channel, message: self._peer.send(channel, message), self._until)

    def _new_peer(self, relay: str = "") -> Peer:
        options = self.options
        return Peer(
            options.link,
            carrier=options.carrier,
            video=options.video,
            audio=options.audio,
            codec=options.codec,
            route=options.route,
            tls_ca=options.tls_ca,
            relay_only=options.relay_only,
            on_message=self._received,
            relay=relay,
            sound_codec=options.sound_codec,
        )

    # Open and close

    async def open(self) -> None:
        """Connect and wait until the robot is known. Raises SignallingRefused or ConnectFailed."""
        deadline = self._loop.time() + self.options.connect_seconds
        where = await self._peer.relay_ticket() if self.options.through_relay else None
        wanted = {"video": self.options.video, "audio": int(self.options.audio)}
        if where is not None:
            await self._go_beside(where)
        sections = await self._negotiate(deadline)
        if isinstance(self._peer, Peer) and where is None:
            self.media.prepare(self._peer, sections, self.options.decode)
        await self._peer.connect(deadline - self._loop.time())
        if where is not None:
            await self._watch_through(wanted, deadline)
        self._heard_at = self._loop.time()
        self._peer.send("session", Rename(name=self.options.name))
        self._running = self._loop.create_task(self._run(), name="console connection")
        try:
            async with asyncio.timeout_at(deadline):
                await self._until(lambda: self.session.welcome is not None and self._driver is not None)
        except TimeoutError:
            raise ConnectFailed("connected, but the console did not describe its robot") from None
        except ConsoleLost as error:
            raise ConnectFailed(error.detail) from error

    async def _go_beside(self, where: RelayTicket) -> None:
        """Switch to a WebSocket for everything but media and feedback, which come from a relay."""
        self._beside = where.relay
        self.options = options = replace(self.options, video=0, audio=False, carrier="trailer")
        self.media = MediaReceiver("trailer", options.tolerance, options.gate, self._rendered)
        await self._peer.close()
        self._peer = ObserverWebSocket(
            options.link, where.relay, options.tls_ca, self._received, options.silence_seconds
        )

    async def _watch_through(self, wanted: dict[str, int], deadline: float) -> None:
        """Subscribe at the relay once connected: the console gives the relay's key only to a connected observer."""
        try:
            async with asyncio.timeout_at(deadline):
                await self._until(lambda: self.session.welcome is not None)
        except TimeoutError:
            raise ConnectFailed("connected, but the console sent nothing") from None
        ticket = await self._peer.relay_ticket(self.welcome.peer)
        if ticket is None:
            raise ConnectFailed("no relay carries the session now")
        relay = self._relay = RelayMedia(ticket, self._received_from_relay)
        first = [each for kind in wanted for each in [s for s in ticket.streams if s.kind == kind][: wanted[kind]]]
        self.media.prepare(relay, await relay.negotiate(lambda stream: stream in first), self.options.decode)
        await relay.connect()

    async def _negotiate(self, deadline: float) -> list[Section]:
        """Negotiate; retry while the console does not reach its robot, and without the WebSocket where none passes."""
        while True:
            try:
                return await self._peer.negotiate()
            except LineBlocked:
                wait = 0.0
            except SignallingRefused as error:
                wait = RETRY_SECONDS
                if error.error != "robot_unreachable" or self._loop.time() + wait > deadline:
                    raise
            await self._peer.close()
            await asyncio.sleep(wait)
            self._peer = self._new_peer(self._beside)

    async def _run(self) -> None:
        """Run the session until the connection ends or is closed."""
        try:
            async with asyncio.TaskGroup() as group:
                tasks = [group.create_task(self.media.run()), group.create_task(self._heartbeat())]
                if self._relay is not None:
                    tasks += [group.create_task(self._relay.run()), group.create_task(self._end_with(self._relay))]
                await self._peer.ended.wait()
                await cancel_all(tasks)
        finally:
            self._end(ConsoleLost(self._peer.why or "closed"))

    async def _end_with(self, relay: RelayMedia) -> None:
        await relay.ended.wait()
        self._peer.lose(relay.why)

    def _end(self, lost: ConsoleLost) -> None:
        if self.lost is not None:
            return
        self.lost = lost
        if self._driver is not None:
            self._driver.end(lost)
        self.media.end()
        for reader in self.feedback_readers:
            reader.close()
        self._wake_waiters()

    async def close(self) -> None:
        """End everything, even if cancelled meanwhile. Idempotent."""
        await finish(self._close())

    async def _close(self) -> None:
        await self._peer.close()
        if self._relay is not None:
            await self._relay.close()
        if self._running is not None:
            await self._running
        self._end(ConsoleLost("closed"))
        self.media.close()

    async def _until(self, condition: Callable[[], bool]) -> None:
        """Wait until a message makes the condition true. Raises ConsoleLost."""
        while not condition():
            if self.lost is not None:
                raise self.lost
            await self._changed.wait()

    def _wake_waiters(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()

    async def _heartbeat(self) -> None:
        await self._until(lambda: self._driver is not None)
        early_pings = EARLY_PINGS
        while True:
            now = self._loop.time()
            if now - self._heard_at > self.options.silence_seconds:
                self._peer.lose(f"the console was silent for {self.options.silence_seconds:g} s")
            if self._pings.lost(now):
                self.driver.loss()
            ping = self._pings.send(now)
            if early_pings:
                early_pings -= 1
                self._peer.send("control", Ping(id=ping))
                await asyncio.sleep(EARLY_PING)
                continue
            self._peer.send("control", self._report(ping))
            self.media.reported()
            await asyncio.sleep(self._beat())

    def _beat(self) -> float:
        if self._relay is not None:
            return LINE_HEARTBEAT if isinstance(self._peer, ObserverWebSocket) else RELAYED_HEARTBEAT
        return OBSERVER_HEARTBEAT if self._is_observer() else HEARTBEAT

    def _is_observer(self) -> bool:
        welcome = self.session.welcome
        return welcome is not None and welcome.role == "observer"

    # Messages from the console

    def _received_from_relay(self, data: str | bytes) -> None:
        """Take only the kinds of message that this client asked the relay for."""
        try:
            message = decode_server_message(data)
        except MessageError:
            self.malformed += 1
            return
        if isinstance(message, Feedback | Pong):
            self._received(data)

    def _received(self, data: str | bytes) -> None:
        try:
            message = decode_server_message(data)
        except MessageError:
            self.malformed += 1
            return
        self._heard_at = self._loop.time()
        match message:
            case Feedback():
                self._take_feedback(message)
            case Refusal():
                self._take_refusal(message)
            case Pong(id=number):
                round_trip = self._pings.answered(number, self._heard_at)
                if round_trip is not None and self._driver is not None:
                    self._driver.sender.ping_answered(round_trip)
                if round_trip is not None:
                    self.media.round_trip(round_trip)
            case RobotState():
                self._take_robot(message)
            case StopStateNotice():
                self.session.stop_shown(message.stop)
            case StopTaken():
                self.session.stop_taken(message)
            case Welcome() | Seat() | Participants() | SharedNote():
                self.session.hear(message)
        self._wake_waiters()

    def _take_feedback(self, feedback: Feedback) -> None:
        if self._driver is None:
            self._early_feedback = feedback
            return
        if not self._driver.feedback(feedback):
            return
        self.session.stop_shown(feedback.stop)
        now = self._loop.time()
        self._event_rate.event(feedback.event, now)
        self.feedback_log.append(FeedbackArrival(now, feedback.event))
        self.media.feedback(feedback.event)
        for reader in self.feedback_readers:
            reader.put(feedback)

    def _take_refusal(self, refusal: Refusal) -> None:
        if refusal.event == 0:
            self.session.refused(refusal)
        if self._driver is not None and (refusal.event or refusal.reason == "link_down"):
            self._driver.refusal(refusal)

    def _take_robot(self, robot: RobotState) -> None:
        self._robot = robot
        if self._driver is not None:
            if robot.link == "down":
                self._driver.hold_back("link_down")
            return
        description = robot.description
        rate = min(description.max_event_rate, self.options.event_rate or description.max_event_rate)
        gate = CommandGate(self.options.pacing, self.options.tolerance["video"], 1 / rate)
        sender = CommandSender(gate, [axis.rest for axis in description.axes])
        self._driver = Driver(sender, lambda message: self._peer.send("control", message))
        self.session.seated, self.session.unseated = sender.seated, sender.unseated
        sender.holds_seat = self.session.holds_seat
        if self._early_feedback is not None:
            self._take_feedback(self._early_feedback)

    def _rendered(self, stream: str, stamp: int) -> None:
        cameras = self._robot.description.cameras if self._robot is not None else ()
        if self._driver is not None and cameras and stream == cameras[0].name:
            self._driver.shown(stamp)

    # Known after `open`

    @property
    def driver(self) -> Driver:
        if self._driver is None:
            raise ConsoleLost("not connected yet")
        return self._driver

    @property
    def robot(self) -> RobotState:
        if self._robot is None:
            raise ConsoleLost("not connected yet")
        return self._robot

    @property
    def welcome(self) -> Welcome:
        if self.session.welcome is None:
            raise ConsoleLost("not connected yet")
        return self.session.welcome

    @property
    def relay(self) -> str:
        return "" if self._relay is None else self._relay.name

    def statistics(self) -> ConsoleStatistics:
        now = self._loop.time()
        sender, delays = self.driver.sender, self.driver.picture_delay.samples
        delay = percentiles(delays, 1000)
        return ConsoleStatistics(
            peer=self.session.peer,
            epoch=self.robot.epoch,
            event=sender.newest.event if sender.newest is not None else 0,
            armed=sender.armed,
            gate=sender.gate.state(now),
            streams=self.media.statistics(),
            picture_delay_ms=delays[-1] * 1000 if delays else None,
            picture_delay_p50_ms=delay.median,
            picture_delay_p95_ms=delay.p95,
            command_to_picture_ms=delay,
            round_trip_ms=self._pings.round_trip * 1000 if self._pings.round_trip is not None else None,
            command_to_feedback_ms=percentiles(sender.samples, 1000),
            event_rate=self._event_rate.rate(now),
            bad_messages=self.malformed,
            repeats=sender.repeats,
            echoes=sender.echoes,
        )

    def _report(self, ping: int) -> Report:
        sender, round_trip = self.driver.sender, self._pings.round_trip
        delay = self.driver.picture_delay.known(asyncio.get_running_loop().time())
        return Report(
            event=sender.newest.event if sender.newest is not None else 0,
            armed=sender.armed,
            streams=[stream.report() for stream in self.media.statistics()],
            picture_delay_ms=delay * 1000 if delay is not None else None,
            round_trip_ms=round_trip * 1000 if round_trip is not None else None,
            ping=ping,
        )

    # Requests to the console

    async def restart_ice(self) -> None:
        """Look for a new path to the console. Raises SignallingRefused or ConnectFailed."""
        await self._peer.restart_ice(self.options.connect_seconds)

    async def stop(self, reason: str) -> StopState:
        """Latch the stop. Raises StopUnconfirmed if neither the data channel nor HTTP brought the robot's answer."""
        press = secrets.token_hex(16)
        self._peer.send("stop", Stop(by=self.options.name, reason=reason, press=press))
        # An observer's message on a channel may wait behind those of a crowd; a stop by HTTP waits for no other
        # request.
        if self._is_observer() or not await self._is_confirmed_soon(press):
            await self._stop_by_http(reason, press)
        if self._driver is not None:
            self._driver.hold_back("stopped")
        confirmed = self.session.confirmed(press)
        if confirmed is None:
            raise StopUnconfirmed(press, "the stop was not confirmed")
        return replace_struct(confirmed, by=confirmed.by or self.options.name, reason=confirmed.reason or reason)

    async def _is_confirmed_soon(self, press: str) -> bool:
        try:
            async with asyncio.timeout(STOP_SECONDS):
                await self._until(lambda: self.session.confirmed(press) is not None)
        except (TimeoutError, ConsoleLost):
            return False
        return True

    async def _stop_by_http(self, reason: str, press: str) -> None:
        try:
            self.session.stop_taken(await self._peer.stop_by_http(reason, press))
        except ConsoleError as error:
            if not await self._is_confirmed_soon(press):  # by the channel
                raise StopUnconfirmed(press, f"the stop was not confirmed: {error}") from error
