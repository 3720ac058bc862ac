"""Publishes the session in a Janus, as one publisher: encoded media with trailers, and feedback on a data channel."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Protocol

from lockstep.protocol.janus import Heard, complete_description
from lockstep.rtc.channels import ChannelWritable
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.endpoint import Connection, TooManyPeers
from lockstep.rtc.peer import OfferedMedia
from lockstep.rtc.peer_events import Connected, MediaEvent, PeerEnded, PeerEvent
from lockstep.rtc.sdp import SdpError, parse_description, write_description
from lockstep.server.media.planning import MediaPlan
from lockstep.server.media.subscribers import Subscribers
from lockstep.server.media.subscriptions import Subscriptions
from lockstep.server.peers.channel_writer import ChannelWriter
from lockstep.server.sfu.errors import RelayRefused, RelaySilent
from lockstep.server.sfu.janus_room import JanusRoom
from lockstep.server.sfu.janus_session import JanusSession
from lockstep.server.sfu.publication import NEW_EPOCH, Publication

__all__ = ["Connect", "PublishedMedia", "publish"]

CONNECT_SECONDS = 15.0
FEEDBACK = "feedback"  # label of the data channel
NEWEST_WINS = Reliability(ordered=False, max_retransmits=0)


class Connect(Protocol):
    """The part of the console's endpoint that publishing needs."""

    async def connect(self, *, controlling: bool) -> Connection: ...


class PublishedMedia(Protocol):
    """The part of the media hub that publishing needs."""

    def plan_publication(self, camera_codec: str = "") -> tuple[MediaPlan, list[OfferedMedia]]: ...
    @property
    def subscribers(self) -> Subscribers: ...


@asynccontextmanager
async def publish(
    session: JanusSession,
    room_of: Callable[[JanusSession], JanusRoom],
    endpoint: Connect,
    media: PublishedMedia,
    feed: int,
    codec: str = "",
) -> AsyncIterator[Publication]:
    """Publish while entered; the yielded publication tells of an earlier end. Raises RelayError on entering."""
    room = room_of(session)
    found: list[Publication] = []

    def heard(event: Heard) -> None:
        if event.kind == "ended" and found:
            found[0].end(event.detail)

    handle = await session.attach(heard)
    await room.prepare(handle)
    try:
        connection = await endpoint.connect(controlling=True)
    except TooManyPeers as error:
        raise RelayRefused("this console has reached its limit of connections") from error
    given: Subscriptions | None = None
    try:
        plan, offered = media.plan_publication(codec)
        given = media.subscribers.publish(connection, plan)
        offer = write_description(connection.offer(offered))
        names = {stream.mid: stream.stream for stream in given.streams}
        answer = complete_description(await room.publish(handle, feed, offer, names))
        try:
            connection.accept(parse_description(answer))
        except SdpError as error:
            raise RelayRefused(f"the relay's answer cannot be used: {error}") from error
        writer = ChannelWriter(connection, connection.open_channel(FEEDBACK, reliability=NEWEST_WINS))
        publication = Publication(feed, given.streams, writer.send_newest)
        line = _Line(connection, given, writer, publication)
        given.on_failed(publication.failed)
        given.ending.on_ended(line.streams_ended)
        found.append(publication)
        connection.listen(line.heard)
        await _connected(line, publication)
        yield publication
    finally:
        if given is not None:
            await given.close()
        connection.close()


class _Line:
    """Handles the events of the connection to the relay."""

    def __init__(
        self, connection: Connection, media: Subscriptions, writer: ChannelWriter, publication: Publication
    ) -> None:
        self.decided = asyncio.Event()  # set when the connection is made, has failed, or is not needed any more
        self._connection = connection
        self._media = media
        self._writer = writer
        self._publication = publication

    def streams_ended(self) -> None:
        """End the publication: another epoch has begun, which may be in the middle of its negotiation."""
        self._publication.end(NEW_EPOCH)
        self.decided.set()

    def heard(self, event: PeerEvent) -> None:
        try:
            self._take(event)
        except Exception as error:
            self._publication.failed("media", error)
            self.decided.set()

    def _take(self, event: PeerEvent) -> None:
        if isinstance(event, MediaEvent):
            self._media.heard(event.mid, event.event)
        elif isinstance(event, ChannelWritable):
            self._writer.flush()
        elif isinstance(event, Connected):
            self._media.connected()
            self.decided.set()
        elif isinstance(event, PeerEnded):
            if self._connection.fault is not None:
                raise self._connection.fault
            self._publication.end(f"connection ended: {event.reason}")
            self.decided.set()


async def _connected(line: _Line, publication: Publication) -> None:
    try:
        async with asyncio.timeout(CONNECT_SECONDS):
            await line.decided.wait()
    except TimeoutError as error:
        raise RelaySilent("no path for media") from error
    if publication.ended.is_set() and publication.why != NEW_EPOCH:
        raise RelaySilent(publication.why)
