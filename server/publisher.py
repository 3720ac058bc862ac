"""One publisher: somebody's connection by WHIP, from its answer to its end."""

import asyncio
import secrets
import sys
import time
from collections.abc import Awaitable, Callable
from typing import Literal, Protocol

import msgspec
import structlog
from aiortc import RTCPeerConnection

from server.access import Identity
from server.audit import Actor
from server.channels import MessageBudget
from server.errors import Flood, TooManyRequests
from server.ice_restart_private import IceSession
from server.media.aiortc_private import close_or_force
from server.media.published.encoded_wire import Encoded, encode_picture
from server.media.published.incoming_pictures import IncomingPictures
from server.media.published.picture_assembly import MediaPacket
from server.media.published.published_camera import PublishedCamera
from server.media.published.receiver_private import PictureSection
from server.media.sources.reader_process import ReaderProcess
from server.media.sources.source_wire import Captured, Said, Trouble
from server.names import clean_name

__all__ = ["PacketOutcome", "Publisher", "PublisherLimits"]

log = structlog.get_logger(__name__)

COMMAND = (sys.executable, "-m", "server.media.published.decoder_process")
MAX_REQUESTS = 10.0  # Hz, of candidates and ICE restarts, after a burst of as many
LOOK_SECONDS = 0.05  # between two looks at what is missing
REPORT_SECONDS = 1.0
STALLED_SECONDS = 3.0  # without a picture; then the page says so
MOST_BPS = 6_000_000  # that a publisher is asked not to exceed
MOST_FLOODED = 10_000  # packets beyond every budget, then it ends
CLOSE_TIMEOUT = 5.0  # s

PacketOutcome = Literal["lost", "malformed", "foreign", "flooded", "not_decoded"]


class PublisherLimits(Protocol):
    """The settings that a publisher needs."""

    @property
    def peer_connect_timeout(self) -> float: ...
    @property
    def peer_silence(self) -> float: ...


class Publisher:
    """Await `run`; it returns when the publication has ended and everything of it is closed. `end` asks for that.

    What it sends can end it, and nothing else: its pictures are decoded in a process of its own.

    Attributes:
        resource: secret: the path of the WHIP session
        ended: why; "" while it lives
        ice: its ICE session; set before `run`
    """

    ice: IceSession

    def __init__(
        self, pc: RTCPeerConnection, camera: PublishedCamera, identity: Identity, limits: PublisherLimits
    ) -> None:
        self.id = secrets.token_hex(4)
        self.resource = secrets.token_urlsafe(16)
        self.pc = pc
        self.camera = camera
        self.identity = identity
        self.name = clean_name(identity.name, identity.role)
        self.ended = ""
        self._limits = limits
        self._loop = asyncio.get_running_loop()
        self._requests = MessageBudget(MAX_REQUESTS, self._loop.time())
        self._end = asyncio.Event()
        self._connected = asyncio.Event()
        self._section: PictureSection | None = None  # None before the answer
        self._incoming: IncomingPictures | None = None  # likewise
        self._decoder = ReaderProcess(camera.spec.name, COMMAND, self._decoded, None)
        self._shown_at = time.monotonic()  # when the last picture came, or the publication began
        self._not_decoded = 0
        pc.on("connectionstatechange", self._connection_changed)

    @property
    def actor(self) -> Actor:
        """For the audit."""
        return Actor(self.name, self.identity.role, self.id, self.identity.token_id)

    @property
    def stalled(self) -> bool:
        """Whether no picture came for a while; the same link may then publish anew."""
        return time.monotonic() - self._shown_at > STALLED_SECONDS

    @property
    def path_seconds(self) -> float | None:
        """By how much more its pictures are taken to be old than its camera's latency says."""
        return None if self._incoming is None else self._incoming.path.seconds(time.monotonic())

    def counts(self) -> dict[PacketOutcome, int]:
        """What came and could not be used, since the start."""
        incoming = self._incoming
        return {
            "lost": 0 if incoming is None else incoming.lost,
            "malformed": 0 if incoming is None else incoming.malformed,
            "foreign": 0 if self._section is None else self._section.foreign,
            "flooded": 0 if incoming is None else incoming.flooded,
            "not_decoded": self._not_decoded,
        }

    def take_request(self) -> None:
        """Count a PATCH. Raises TooManyRequests."""
        try:
            self._requests.spend(self._loop.time())
        except Flood as error:
            raise TooManyRequests(f"more than {MAX_REQUESTS:g} requests a second for one session") from error

    def end(self, why: str) -> None:
        """Only the first reason counts."""
        if not self.ended:
            self.ended = why
            self._end.set()

    def receives(self, section: PictureSection) -> None:
        """Its pictures come in this section. Call once, before the answer."""
        self._section = section
        self._incoming = IncomingPictures(section.codec, self.camera.spec.latency, time.monotonic())

    def packet(self, packet: MediaPacket) -> None:
        """One packet of its pictures."""
        if self._incoming is not None and not self.ended:
            self._pass_on(self._incoming.take(packet, time.monotonic()))

    def round_trip(self, seconds: float) -> None:
        """One was measured on its path."""
        if self._incoming is not None:
            self._incoming.path.observe(seconds, time.monotonic())

    async def run(self, link_ended: Callable[[], Awaitable[None]]) -> None:
        """`link_ended` returns when its link is good no more."""
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
            await self.close()

    async def close(self) -> None:
        """Its connection. Instead of `run` where it was never admitted."""
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                await self.ice.close()
                await close_or_force(self.pc)
        except TimeoutError:
            log.warning("publisher did not close in time", peer=self.id)

    async def _decode(self) -> None:
        await self._connected.wait()  # who never connects costs no process
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
        """Ask for what is missing, report, and see whether anything still comes."""
        await self._connected.wait()
        self._shown_at = time.monotonic()
        reported = 0.0
        while self._incoming is not None and self._section is not None:
            now = time.monotonic()
            self._ask(self._incoming, self._section, now)
            if now - reported >= REPORT_SECONDS:
                reported = now
                self._section.report(MOST_BPS, now)
            self._check_silence(self._incoming, now)
            await asyncio.sleep(LOOK_SECONDS)

    def _ask(self, incoming: IncomingPictures, section: PictureSection, now: float) -> None:
        self._pass_on(incoming.look(now))
        requests = incoming.requests(now)
        section.request_packets(requests.packets)
        if requests.keyframe:
            section.request_keyframe()
        if incoming.late:
            self.end("late")
        elif max(incoming.flooded, section.foreign) > MOST_FLOODED:
            self.end("too much")

    def _check_silence(self, incoming: IncomingPictures, now: float) -> None:
        if now - (incoming.heard_at or self._shown_at) > self._limits.peer_silence:
            self.end("silent")
        elif self.stalled and self.camera.state != "reconnecting":
            self.camera.failed(self, "silent", "nothing comes any more")

    def _pass_on(self, pictures: list[Encoded]) -> None:
        for picture in pictures:
            if not self._decoder.write(encode_picture(picture)) and self._incoming is not None:
                self._incoming.lost_picture()  # the decoder is too slow; it goes on with a keyframe

    def _decoded(self, said: Said) -> None:
        if isinstance(said, Captured):
            self._shown_at = time.monotonic()
            self.camera.captured(self, said, self.name)
        elif isinstance(said, Trouble):
            self._not_decoded += 1
            if self._incoming is not None:
                self._incoming.lost_picture()

    def _connection_changed(self) -> None:
        state = self.pc.connectionState
        if state == "connected":
            self._connected.set()
        elif state in ("failed", "closed"):
            self.end(f"connection {state}")
