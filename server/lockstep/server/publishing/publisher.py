"""One publisher: a client's connection by WHIP, from its answer to its end."""

import asyncio
import secrets
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Literal, Protocol

import msgspec
import structlog

from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer import PeerNotReady
from lockstep.rtc.peer_events import Answered, Connected, PacketReceived, PeerEnded, PeerEvent
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.server.audit.records import Actor
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import Flood, TooManyRequests
from lockstep.server.media.published.depacketise import PictureCodec
from lockstep.server.media.published.encoded_wire import PICTURES, Encoded
from lockstep.server.media.published.incoming_pictures import IncomingPictures
from lockstep.server.media.published.picture_assembly import MediaPacket
from lockstep.server.media.published.published_camera import PublishedCamera
from lockstep.server.media.sources.reader_process import ReaderProcess
from lockstep.server.media.sources.source_wire import Captured, Said, Trouble
from lockstep.server.peers.channels import MessageBudget
from lockstep.server.util.display_names import clean_name
from lockstep.server.webrtc.ice_session import IceSession

__all__ = ["PacketOutcome", "Publisher", "PublisherLimits"]

log = structlog.get_logger(__name__)

COMMAND = (sys.executable, "-m", "lockstep.server.media.published.decoder_process")
MAX_REQUESTS = 10.0  # Hz, of candidates and ICE restarts, after a burst of as many
LOOK_SECONDS = 0.05  # between two looks at what is missing
STALLED_SECONDS = 3.0  # without a picture; then the page says so
MOST_BPS = 6_000_000  # bit rate that a publisher is asked not to exceed
MOST_FLOODED = 10_000  # packets beyond every budget; then it ends
ENDS = {"consent_expired": "consent expired", "no_path": "connection failed"}  # reasons that a connection ends

PacketOutcome = Literal["lost", "malformed", "foreign", "flooded", "not_decoded"]


class PublisherLimits(Protocol):
    """The settings that a publisher needs."""

    @property
    def peer_connect_timeout(self) -> float: ...
    @property
    def peer_silence(self) -> float: ...


class Publisher:
    """Await `run`; it returns when the publication has ended and everything of it is closed. `end` asks for that.

    Its packets can end it, and nothing else: its pictures are decoded in a separate process.

    Attributes:
        resource: secret path of the WHIP session
        ended: reason of the end; "" while it lives
        ice: its ICE session; set by `receives`
    """

    ice: IceSession

    def __init__(self, camera: PublishedCamera, identity: Identity, limits: PublisherLimits) -> None:
        self.id = secrets.token_hex(4)
        self.resource = secrets.token_urlsafe(16)
        self.camera = camera
        self.identity = identity
        self.name = clean_name(identity.name, identity.role)
        self.ended = ""
        self._limits = limits
        self._loop = asyncio.get_running_loop()
        self._requests = MessageBudget(MAX_REQUESTS)
        self._end = asyncio.Event()
        self._connected = asyncio.Event()
        self._connection: Connection | None = None  # None before the answer
        self._incoming: IncomingPictures | None = None  # likewise
        self._mid = ""  # of the section in which its pictures come
        self._ssrc: int | None = None  # of its pictures; None before the first packet
        self._foreign = 0  # packets of another source
        self._fault: Exception | None = None  # exception from handling its packets
        self._decoder = ReaderProcess(camera.spec.name, COMMAND, self._decoded, None)
        self._shown_at = time.monotonic()  # time of the last picture, or of the publication's begin
        self._not_decoded = 0

    @property
    def actor(self) -> Actor:
        """This publisher, for the audit."""
        return Actor(self.name, self.identity.role, self.id, self.identity.token_id)

    @property
    def stalled(self) -> bool:
        """True if no picture came for a while; the same link may then publish anew."""
        return time.monotonic() - self._shown_at > STALLED_SECONDS

    @property
    def path_seconds(self) -> float | None:
        """The age that its pictures are taken to have beyond its camera's latency."""
        return None if self._incoming is None else self._incoming.path.seconds(time.monotonic())

    def counts(self) -> dict[PacketOutcome, int]:
        """Return the counts of packets and pictures that could not be used, since the start."""
        incoming = self._incoming
        return {
            "lost": 0 if incoming is None else incoming.lost,
            "malformed": 0 if incoming is None else incoming.malformed,
            "foreign": self._all_foreign(),
            "flooded": self._all_flooded(),
            "not_decoded": self._not_decoded,
        }

    def take_request(self) -> None:
        """Count a PATCH. Raises TooManyRequests."""
        try:
            self._requests.spend(self._loop.time())
        except Flood as error:
            raise TooManyRequests(f"more than {MAX_REQUESTS:g} requests a second for one session") from error

    def end(self, why: str) -> None:
        """End the publication. Only the first reason counts."""
        if not self.ended:
            self.ended = why
            self._end.set()

    def receives(self, connection: Connection, username: str, mid: str, codec: PictureCodec) -> None:
        """Take its pictures from section `mid`. Call once, with the answer; `username` is of the offer."""
        self._connection, self._mid = connection, mid
        self._incoming = IncomingPictures(codec, self.camera.spec.latency)
        self.ice = IceSession(connection, username)
        connection.limit(mid, MOST_BPS)

    def heard(self, event: PeerEvent) -> None:
        """Take an event of its connection."""
        try:
            self._take(event)
        except Exception as error:
            self._fault = self._fault or error
            self.end("internal error")

    def _take(self, event: PeerEvent) -> None:
        if isinstance(event, PacketReceived):
            self._packet(event.packet)
        elif isinstance(event, Answered):
            self._round_trip(event.seconds)
        elif isinstance(event, Connected):
            self._connected.set()
        elif isinstance(event, PeerEnded):
            if self._connection is not None and self._connection.fault is not None:
                raise self._connection.fault
            self.end(ENDS.get(event.reason, "connection closed"))

    def _packet(self, packet: RtpPacket) -> None:
        if self._incoming is None or self.ended:
            return
        self._ssrc = packet.ssrc if self._ssrc is None else self._ssrc
        if packet.ssrc != self._ssrc:
            self._foreign += 1
            return
        taken = MediaPacket(packet.sequence_number, packet.timestamp, packet.marker, packet.payload)
        self._pass_on(self._incoming.take(taken, time.monotonic()))

    def _round_trip(self, seconds: float) -> None:
        """Take a round trip that was measured on its path."""
        if self._incoming is not None and self._connection is not None:
            self._incoming.path.observe(seconds, time.monotonic())
            self._connection.peer.share.round_trip.measure(seconds)

    def _all_foreign(self) -> int:
        if self._connection is None:
            return self._foreign
        streams = self._connection.peer.media.streams
        return self._foreign + streams.counts["rtp_unknown"] + streams.incoming[self._mid].ignored

    def _all_flooded(self) -> int:
        incoming, connection = self._incoming, self._connection
        if incoming is None or connection is None:
            return 0
        return incoming.flooded + connection.counts["receive_overflow"]

    async def run(self, link_ended: Callable[[], Awaitable[None]]) -> None:
        """Run until its end. `link_ended` returns when its link is no longer valid."""
        structlog.contextvars.bind_contextvars(peer=self.id)
        try:
            async with asyncio.TaskGroup() as tasks:
                working = [
                    tasks.create_task(self._decode(), name="decode"),
                    tasks.create_task(self._look(), name="look"),
                    tasks.create_task(self._end_with(link_ended), name="link"),
                    tasks.create_task(self._end_unless_connected(), name="connect"),
                ]
                try:
                    await self._end.wait()
                finally:
                    for task in working:
                        task.cancel()
        finally:
            self.end("closed")
            self.close()
        if self._fault is not None:
            raise self._fault

    def close(self) -> None:
        """Close its connection. Call it instead of `run` if it was never admitted."""
        if self._connection is not None:
            self._connection.close()

    async def _decode(self) -> None:
        await self._connected.wait()  # a client that never connects costs no process
        why = await self._decoder.run(msgspec.json.encode(self.camera.spec) + b"\n")
        self.end(f"decoder {why}")

    async def _end_with(self, link_ended: Callable[[], Awaitable[None]]) -> None:
        await link_ended()
        self.end("link ended")

    async def _end_unless_connected(self) -> None:
        try:
            async with asyncio.timeout(self._limits.peer_connect_timeout):
                await self._connected.wait()
        except TimeoutError:
            self.end("never connected")

    async def _look(self) -> None:
        """Give up missing packets, ask for keyframes, and check for silence."""
        await self._connected.wait()
        self._shown_at = time.monotonic()
        while self._incoming is not None and self._connection is not None:
            now = time.monotonic()
            self._ask(self._incoming, self._connection, now)
            self._check_silence(self._incoming, now)
            await asyncio.sleep(LOOK_SECONDS)

    def _ask(self, incoming: IncomingPictures, connection: Connection, now: float) -> None:
        self._pass_on(incoming.look(now))
        if incoming.wants_keyframe(now):
            with suppress(PeerNotReady):  # it has ended
                connection.request_keyframe(self._mid)
        if incoming.late:
            self.end("late")
        elif max(self._all_flooded(), self._all_foreign()) > MOST_FLOODED:
            self.end("too much")

    def _check_silence(self, incoming: IncomingPictures, now: float) -> None:
        if now - (incoming.heard_at or self._shown_at) > self._limits.peer_silence:
            self.end("silent")
        elif self.stalled and self.camera.state != "reconnecting":
            self.camera.failed(self, "silent", "no data arrives")

    def _pass_on(self, pictures: list[Encoded]) -> None:
        for picture in pictures:
            if not self._decoder.write(PICTURES.encode(picture)) and self._incoming is not None:
                self._incoming.lost_picture()  # the decoder is too slow; it goes on with a keyframe

    def _decoded(self, said: Said) -> None:
        if isinstance(said, Captured):
            self._shown_at = time.monotonic()
            self.camera.captured(self, said, self.name)
        elif isinstance(said, Trouble):
            self._not_decoded += 1
            if self._incoming is not None:
                self._incoming.lost_picture()
