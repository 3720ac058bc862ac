"""One peer: its messages, its heartbeat, its end. They travel on its transport, which is WebRTC or a WebSocket."""

import asyncio
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

import structlog

from lockstep.protocol.console import (
    ClientMessage,
    Quality,
    Report,
    Role,
    ServerMessage,
    StreamInfo,
    Tier,
    encode_console_message,
)
from lockstep.protocol.traces.trace_messages import PictureTrace
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.audit.records import Actor
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ChannelError, TransportRefused
from lockstep.server.media.picture_traces import PictureTraces
from lockstep.server.peers.channels import ChannelName, channel_of, stop_in
from lockstep.server.peers.liveness import Liveness
from lockstep.server.peers.message_reader import MessageReader
from lockstep.server.peers.repeat_reply_limiter import RepeatReplyLimiter
from lockstep.server.peers.transport import Transport
from lockstep.server.util.display_names import clean_name

__all__ = ["Peer", "PeerHost", "PeerLimits", "PeerStreams"]

log = structlog.get_logger(__name__)

ASK_RATE = 2.0  # Hz, of requests that everyone is told of: seat, name
ASK_BURST = 10.0
CLOSE_TIMEOUT = 5.0  # s; goodbye is said to the remote, which may not answer


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
        self.role: Role = identity.role
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
        self.media = media
        self.host = host
        self._loop = asyncio.get_running_loop()
        self._channels: set[ChannelName] = set()  # that are open
        self.asks = TokenBucket(ASK_RATE, ASK_BURST)  # of requests that concern everybody
        self.answers = RepeatReplyLimiter()  # to repeats of its commands
        self.liveness = Liveness(
            limits.peer_connect_timeout if connect_seconds is None else connect_seconds,
            limits.peer_silence if silence_seconds is None else silence_seconds,
        )
        rate = limits.max_observer_rate if identity.role == "observer" else limits.max_message_rate
        self._reader = MessageReader(rate, limits.max_bad_messages)
        media.on_quality(self._quality_decided)
        media.on_failed(self.failed)
        transport.listen(self)

    async def run(self) -> None:
        structlog.contextvars.bind_contextvars(peer=self.id)
        try:
            self.end(await self.liveness.watch())
        finally:
            self.end("closed")
            await self.close()

    def end(self, why: str) -> None:
        """End the peer. Only the first reason counts."""
        if not self.ended:
            self.ended = why
            self.liveness.end()
            with self.contained("end"):
                self.host.peer_ended(self)

    def failed(self, stage: str, error: Exception) -> None:
        """End the peer, since serving it raised `error`. Only the first error is reported."""
        if not self._has_failed:
            self._has_failed = True
            self.host.peer_failed(self, stage, error)
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

    def send_spare(self, text: str) -> None:
        """Send on the control channel unless something waits there: feedback comes first."""
        if "control" in self._channels and not self.ended:
            with self.contained("message out"):
                self.transport.send_spare(text)

    def drives(self, holds_seat: bool) -> None:
        """Set whether it holds the control seat."""
        with self.contained("media"):
            self.media.drives(holds_seat)

    def want_traces(self, wanted: bool) -> None:
        """Begin or end keeping which pictures are sent to it, and when."""
        with self.contained("media"):
            self.media.traces.want(wanted)

    def take_traces(self, most: int) -> list[PictureTrace]:
        """Return what was sent since the last call: of each camera the newest pictures, `most` of them."""
        traces: list[PictureTrace] = []
        with self.contained("media"):
            traces += self.media.traces.take(most)
        return traces

    def _quality_decided(self, quality: Quality) -> None:
        self._quality = quality
        self.send("session", quality)

    async def close(self) -> None:
        """Close its media and its transport. `run` does so at its end; call it for a peer that is not admitted."""
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                for close in (self.media.close, self.transport.close):
                    with self.contained("close"):
                        await close()
        except TimeoutError:
            log.warning("peer did not close in time", peer=self.id)

    # Called by the transport

    def channel_opened(self, channel: ChannelName) -> None:
        """Send on `channel` from now on."""
        self._channels.add(channel)
        self.liveness.speaks = True
        with self.contained("channel"):
            self.host.channel_opened(self, channel)
            if channel == "session" and self._quality is not None:
                self.send("session", self._quality)

    def received(self, channel: ChannelName | None, data: object) -> None:
        """Take a message. `channel`: None on a WebSocket, which carries all. Only a valid message is a sign of life."""
        if self.ended:
            return
        try:
            now = self._loop.time()
            try:
                message = self._reader.read(channel, data, now)
            except ChannelError as error:
                if (stop := stop_in(data)) is not None:
                    self.host.message_received(self, channel or "stop", stop)
                self.refused(channel or "line", error)
                return
            if self._reader.has_given_up:
                self.end("bad messages")  # too many stops; this one is heard all the same
            self.liveness.heard(now)
            if isinstance(message, Report):
                self.report = message
                self.media.report(message, now)
            self.host.message_received(self, channel or channel_of(message), message)
        except Exception as error:
            self.failed("message in", error)

    def refused(self, channel: str, error: ChannelError) -> None:
        """Count bad input. What no transport can hold ends the peer: SCTP and TCP cannot leave a message out."""
        self.host.input_refused(self, channel, error)
        self._reader.refuse(self._loop.time())
        if isinstance(error, TransportRefused):
            self.end("too much")
        elif self._reader.has_given_up:
            self.end("bad messages")
