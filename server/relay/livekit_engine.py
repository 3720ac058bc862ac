"""Relays that are LiveKit: pictures as they are encoded, sound and feedback as data messages.

Its client takes sound as samples only. They would be encoded a second time and carry no event, so that no gate could
let them pass: sound goes in its packets, with the trailer behind each.

A LiveKit grows by servers of its own behind one address. So of several the console publishes into the first that it
reaches, and the others stand by.
"""

import asyncio
import secrets
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass, field
from typing import Protocol

from server.media.frame import EncodedFrame, frame_trailer
from server.media.handover import FrameSink, HandedOverStream
from server.media.peer_media import PeerMedia
from server.relay.livekit_process import COMMAND, LiveKitProcess, open_livekit
from server.relay.livekit_tokens import LiveKitKeys
from server.relay.livekit_wire import Ended, Join, Picture, Room, Said, Sound, Track, WantsKeyframe
from server.relay.publication import Publication
from server.relay.relay_settings import RelaySettings
from server.relay.station import Station
from server.relay.tickets import LiveKitTicket

__all__ = ["HandedOverMedia", "LiveKitEngine"]

PUBLISHER = "lockstep"
BITRATE_ROOM = 1.5  # times the highest bitrate: keyframes come in bursts


class HandedOverMedia(Protocol):
    """What it needs of the media plane."""

    def hand_over(self, sink_of: Callable[[HandedOverStream], FrameSink], camera_codec: str = "") -> PeerMedia: ...


class LiveKitEngine:
    """Every publication has a room of its own, so that a token for an earlier one opens nothing."""

    def __init__(
        self,
        settings: RelaySettings,
        media: HandedOverMedia,
        command: tuple[str, ...] = COMMAND,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        self._keys = LiveKitKeys(settings.relay_key, settings.relay_secret.get_secret_value())
        self._codec = settings.relay_codec
        self._media = media
        self._command = command
        self._wall_clock = wall_clock

    @asynccontextmanager
    async def publish(self, station: Station, feed: int) -> AsyncIterator[Publication]:
        async with open_livekit(self._command) as process:
            outlet = Outlet(process)
            given = self._media.hand_over(outlet.open, self._codec)
            listening: asyncio.Task[None] | None = None
            try:
                publication = Publication(feed, given.streams, process.put_newest)
                given.on_failed(publication.failed)
                room = _room(station, feed)
                token = self._keys.publisher_token(room, PUBLISHER, self._wall_clock())
                await process.join(Join(station.url.address, token, outlet.tracks))
                outlet.joined = True
                listening = asyncio.get_running_loop().create_task(_listen(process, publication, given))
                yield publication
            finally:
                if listening is not None:
                    listening.cancel()
                    await asyncio.gather(listening, return_exceptions=True)
                await given.close()
                await process.close()

    def pass_on(
        self, origin: Station, station: Station, publication: Publication
    ) -> AbstractAsyncContextManager[Publication] | None:
        return None

    def ticket(self, station: Station) -> LiveKitTicket:
        room, identity = _room(station, station.feed), f"observer-{secrets.token_hex(8)}"
        return LiveKitTicket(
            relay=station.name,
            url=station.public,
            feed=station.feed,
            streams=list(station.streams),
            token=self._keys.observer_token(room, identity, self._wall_clock()),
            publisher=PUBLISHER,
        )


@dataclass
class Outlet:
    """What the streams are handed over to."""

    process: LiveKitProcess
    tracks: list[Track] = field(default_factory=list)
    joined: bool = False

    def open(self, stream: HandedOverStream) -> FrameSink:
        index = len(self.tracks)
        width, height = stream.size
        bitrate = int(stream.bitrate_bps * BITRATE_ROOM)
        self.tracks.append(Track(stream.name, stream.kind, stream.codec, width, height, stream.frame_rate, bitrate))

        def take(frame: EncodedFrame) -> bool:
            if not self.joined:
                return False
            # Behind the frame and not as the client's own metadata: docs/relay.md says why.
            data = frame.data + frame_trailer(frame.stamp, frame.capture_time)
            if stream.kind == "audio":
                return self.process.put(Sound(index, frame.media_time & 0xFFFFFFFF, data))
            return self.process.put(Picture(index, frame.keyframe, frame.media_time / 90_000, data))

        return take


async def _listen(process: LiveKitProcess, publication: Publication, given: PeerMedia) -> None:
    while True:
        said = await process.hear()
        if isinstance(said, Ended):
            publication.end(said.detail)
            return
        _heed(said, given)


def _heed(said: Said, given: PeerMedia) -> None:
    if isinstance(said, WantsKeyframe):
        given.request_keyframe(str(said.track))
    elif isinstance(said, Room):
        given.quality.bandwidth(said.bits_per_second, frozenset((said.track,)))


def _room(station: Station, feed: int) -> str:
    return f"{station.url.room}-{feed:x}"
