"""One peer: its messages, its heartbeat, its end. They travel on its transport, which is WebRTC or a WebSocket."""

import asyncio
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

import structlog

from lockstep.protocol.console import (
    ClientMessage,
    Participant,
    Quality,
    Report,
    Role,
    ServerMessage,
    StreamInfo,
    Tier,
    encode_console_message,
)
from lockstep.protocol.messages import Stop
from lockstep.protocol.traces.trace_messages import PictureTrace
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.audit.records import Actor
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ChannelError, Flood, TransportRefused
from lockstep.server.media.picture_traces import PictureTraces
from lockstep.server.peers.channels import ChannelName, MessageBudget, channel_of, parse_message, stop_in
from lockstep.server.peers.repeat_reply_limiter import RepeatReplyLimiter
from lockstep.server.peers.transport import Transport
from lockstep.server.util.display_names import clean_name
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["Peer", "PeerHost", "PeerLimits", "PeerStreams"]

log = structlog.get_logger(__name__)

ASK_RATE = 2.0  # Hz, of requests that everyone is told of: seat, name
ASK_BURST = 10.0
CLOSE_TIMEOUT = 5.0  # s; goodbye is said to the remote, which may not answer
FORGIVEN_RATE = 2.0  # Hz, of bad messages


class PeerLimits(Protocol):
    """The settings that a peer needs."""

    @property
    def peer_silence(self) -> float: ...
    @property
    def peer_connect_timeout(self) -> float: ...
    @property
    def max_message_rate(self) -> float: ...
    @property
    def max_observer_rate(self) -> float: ...
    @property
    def max_bad_messages(self) -> int: ...


class PeerStreams(Protocol):
    """The media that a peer gets."""

    @property
    def streams(self) -> list[StreamInfo]: ...
    @property
    def voice(self) -> str: ...
    @property
    def tier(self) -> Tier | None: ...
    @property
    def loss(self) -> float | None: ...
    @property
    def queues(self) -> bool: ...
    @property
    def round_trip_ms(self) -> float | None: ...
    @property
    def traces(self) -> PictureTraces: ...

    def report(self, report: Report, now: float) -> None: ...
    def drives(self, holds_seat: bool) -> None: ...
    def on_quality(self, tell: Callable[[Quality], None]) -> None: ...
    def on_failed(self, tell: Callable[[str, Exception], None]) -> None: ...

    async def close(self) -> None: ...


class PeerHost(Protocol):
    """Takes the reports of peers. All methods are called on the loop and return at once."""

    def peer_joined(self, peer: "Peer") -> None: ...
    def channel_opened(self, peer: "Peer", channel: ChannelName) -> None: ...
    def message_received(self, peer: "Peer", channel: ChannelName, message: ClientMessage) -> None: ...
    def input_refused(self, peer: "Peer", channel: str, error: ChannelError) -> None: ...
    def peer_ended(self, peer: "Peer") -> None: ...
    def peer_failed(self, peer: "Peer", stage: str, error: Exception) -> None: ...


class Peer:
    """A session: await `run`; it returns when the peer has ended and everything of it is closed.

    `end` ends it from outside, with the reason that logs and metrics show. An exception while it is served ends it
    alone: `failed` is told of the stage, and methods that others call raise nothing.

    It is the `TransportEvents` of its transport.
    """

    def __init__(
        self,
        transport: Transport,
        media: PeerStreams,
        identity: Identity,
        host: PeerHost,
        limits: PeerLimits,
        *,
        connect_seconds: float | None = None,
        silence_seconds: float | None = None,
    ) -> None:
        """`connect_seconds` and `silence_seconds` replace the limits' values."""
        self.id = secrets.token_hex(4)  # public: others see it
        self.identity = identity
        self.wanted_name = clean_name(identity.name, identity.role)
        self.name = ""  # shown to others; `ParticipantList` sets it
        self.report = Report()  # newest
        self._quality: Quality | None = None  # newest
        self.ended = ""  # reason; "" while it lives
        self._has_failed = False
        self.silenced = False  # a supervisor has silenced the stops of its link
        self.thumbnail = False  # a small picture on somebody's overview, not a participant
        self.relay = ""  # the relay that it watches through; "": media and feedback come from here
        self.transport = transport
        self._media = media
        self._host = host
        self._connect_seconds = limits.peer_connect_timeout if connect_seconds is None else connect_seconds
        self._silence_seconds = limits.peer_silence if silence_seconds is None else silence_seconds
        self._loop = asyncio.get_running_loop()
        self._channels: set[ChannelName] = set()  # that are open
        rate = limits.max_observer_rate if identity.role == "observer" else limits.max_message_rate
        self._budget = MessageBudget(rate)
        self._patience = RateLimits(FORGIVEN_RATE, limits.max_bad_messages)
        self.asks = TokenBucket(ASK_RATE, ASK_BURST)  # of requests that concern everybody
        self._answers = RepeatReplyLimiter()
        self._heard_at = self._loop.time()
        self._connected = asyncio.Event()
        self._end = asyncio.Event()
        media.on_quality(self._quality_decided)
        media.on_failed(self.failed)
        transport.listen(self)

    @property
    def connected(self) -> bool:
        """True if it was connected at least once."""
        return self._connected.is_set()

    @property
    def role(self) -> Role:
        return self.identity.role

    @property
    def streams(self) -> list[StreamInfo]:
        return self._media.streams

    @property
    def voice(self) -> str:
        """The media section in which its voice is taken; "" if its voice is not taken."""
        return self._media.voice

    async def run(self) -> None:
        structlog.contextvars.bind_contextvars(peer=self.id)
        try:
            await self._wait_until_connected()
            await self._wait_until_ended()
        finally:
            self.end("closed")
            await self._close()

    def joined(self) -> None:
        """Called when it was admitted."""
        self._host.peer_joined(self)

    def end(self, why: str) -> None:
        """End the peer. Only the first reason counts."""
        if not self.ended:
            self.ended = why
            self._end.set()
            self._connected.set()
            with self.contained("end"):
                self._host.peer_ended(self)

    def failed(self, stage: str, error: Exception) -> None:
        """End the peer, since serving it raised `error`. Only the first error is reported."""
        if not self._has_failed:
            self._has_failed = True
            self._host.peer_failed(self, stage, error)
            self.end("internal error")

    @contextmanager
    def contained(self, stage: str) -> Iterator[None]:
        """Let exceptions of the block end this peer, and nothing else."""
        try:
            yield
        except Exception as error:
            self.failed(stage, error)

    @property
    def actor(self) -> Actor:
        """This peer, for the audit."""
        return Actor(self.name, self.role, self.id, self.identity.token_id)

    def rename(self, name: str) -> None:
        self.wanted_name = clean_name(name, clean_name(self.identity.name, self.identity.role))

    def send(self, channel: ChannelName, message: ServerMessage) -> None:
        with self.contained("message out"):
            self.send_text(channel, encode_console_message(message))

    def send_text(self, channel: ChannelName, text: str) -> None:
        """Send unless the peer has ended or the channel is not open: a newcomer is told everything when it opens."""
        if channel in self._channels and not self.ended:
            with self.contained("message out"):
                self.transport.send(channel, text)

    def send_feedback(self, text: str) -> None:
        if "control" in self._channels and not self.ended:
            try:  # not `contained`: the operator waits for each line here, and in `received`
                self.transport.send_newest(text)
            except Exception as error:
                self.failed("message out", error)

    def want_traces(self, wanted: bool) -> None:
        """Begin or end noting which pictures are sent to it, and when."""
        with self.contained("media"):
            self._media.traces.want(wanted)

    def take_traces(self, most: int) -> list[PictureTrace]:
        """Return the newest pictures since the last call, `most` of each camera."""
        try:
            return self._media.traces.take(most)
        except Exception as error:
            self.failed("media", error)
            return []

    def send_spare(self, text: str) -> None:
        """Send on the control channel unless something waits there: feedback comes first."""
        if "control" in self._channels and not self.ended:
            with self.contained("message out"):
                self.transport.send_spare(text)

    @property
    def round_trip(self) -> float:
        """Round trip time by RTCP, in seconds; 0 before the first measurement."""
        return (self._media.round_trip_ms or 0.0) / 1000

    def may_be_answered_again(self) -> bool:
        """Return whether a repeat of its command is answered now; if so, count it."""
        return self._answers.allows(self._loop.time(), queues=self._media.queues)

    def participant(self) -> Participant:
        carriers = [stream.carrier for stream in self.streams]
        return Participant(
            peer=self.id,
            name=self.name,
            role=self.role,
            carrier=carriers[0] if carriers else "trailer" if self.relay else "none",
            gap=max((stream.gap for stream in self.report.streams), key=abs, default=0),
            picture_delay_ms=self.report.picture_delay_ms,
            round_trip_ms=self.report.round_trip_ms,
            loss=None if self._media.loss is None else round(self._media.loss, 2),
            tier=self._media.tier,
            silenced=self.silenced,
        )

    def drives(self, holds_seat: bool) -> None:
        """Note whether it holds the control seat: if so, its media come first."""
        with self.contained("media"):
            self._media.drives(holds_seat)

    def _quality_decided(self, quality: Quality) -> None:
        self._quality = quality
        self.send("session", quality)

    async def _wait_until_connected(self) -> None:
        try:
            async with asyncio.timeout(self._connect_seconds):
                await self._connected.wait()
        except TimeoutError:
            self.end("never connected")

    async def _wait_until_ended(self) -> None:
        while not self.ended:
            try:
                async with asyncio.timeout_at(self._heard_at + self._silence_seconds):
                    await self._end.wait()
            except TimeoutError:
                self._check_silence()

    def _check_silence(self) -> None:
        now = self._loop.time()
        if not self._channels:
            self._heard_at = now  # a plain WHEP player has no channel to speak on; ICE consent watches it
        elif now - self._heard_at >= self._silence_seconds:
            self.end("silent")

    async def abandon(self) -> None:
        """Close a peer that was never admitted. Call it instead of `run`."""
        await self._close()

    async def _close(self) -> None:
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                for close in (self._media.close, self.transport.close):
                    with self.contained("close"):
                        await close()
        except TimeoutError:
            log.warning("peer did not close in time", peer=self.id)

    # Called by the transport

    async def until_ended(self) -> None:
        await self._end.wait()

    def connection_made(self) -> None:
        self._heard_at = self._loop.time()
        self._connected.set()

    def channel_opened(self, channel: ChannelName) -> None:
        """Send on `channel` from now on."""
        self._channels.add(channel)
        with self.contained("channel"):
            self._host.channel_opened(self, channel)
            if channel == "session" and self._quality is not None:
                self.send("session", self._quality)

    def received(self, channel: ChannelName | None, data: object) -> None:
        """Take a message. `channel`: None on a WebSocket, which carries all. Only a valid message is a sign of life."""
        if not self.ended:
            try:
                self._take(channel, data)
            except Exception as error:
                self.failed("message in", error)

    def _take(self, channel: ChannelName | None, data: object) -> None:
        now = self._loop.time()
        try:
            message = self._parse(channel, data, now)
        except ChannelError as error:
            if (stop := stop_in(data)) is not None:
                self._host.message_received(self, channel or "stop", stop)
            self.refused(channel or "line", error)
            return
        self._heard_at = now
        if isinstance(message, Report):
            self.report = message
            self._media.report(message, now)
        self._host.message_received(self, channel or channel_of(message), message)

    def refused(self, channel: str, error: ChannelError) -> None:
        self._host.input_refused(self, channel, error)
        self._lose_patience(self._loop.time())

    def _parse(self, channel: ChannelName | None, data: object, now: float) -> ClientMessage:
        try:
            message = parse_message(channel, data)
        except ChannelError:
            self._budget.spend(now)
            raise
        try:
            self._budget.spend(now)
        except Flood:
            if not isinstance(message, Stop):
                raise
            self._lose_patience(now)  # a stop is heard all the same
        return message

    def overloaded(self, name: str) -> None:
        """End the peer: its transport received more than it can hold. SCTP and TCP cannot leave a message out."""
        self._host.input_refused(self, "transport", TransportRefused(name))
        self.end("too much")

    def _lose_patience(self, now: float) -> None:
        if not self._patience.spend("", now):
            self.end("bad messages")
