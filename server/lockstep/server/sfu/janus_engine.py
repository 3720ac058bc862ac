"""The engine for Janus relays: one gets the session from the console and passes it on to the others."""

import hashlib
import hmac
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

from lockstep.server.sfu.errors import RelayError
from lockstep.server.sfu.janus_publishing import Connect, PublishedMedia, publish
from lockstep.server.sfu.janus_room import JanusRoom, RoomKeys
from lockstep.server.sfu.janus_session import JanusSession, open_janus
from lockstep.server.sfu.publication import Publication
from lockstep.server.sfu.settings import RelaySettings
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.tickets import RelayTicket
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["JanusEngine"]


class JanusEngine:
    """Derives the keys of a room from the console's key, so that a restarted console can go on with its room."""

    def __init__(self, settings: RelaySettings, endpoint: Connect, media: PublishedMedia, key: str) -> None:
        self._codec = settings.relay_codec
        self._admin_key = settings.relay_admin_key.get_secret_value()
        self._endpoint = endpoint
        self._media = media
        self._key = key.encode()
        self._pin = ""  # of the present publication; each has a new one

    @asynccontextmanager
    async def publish(self, station: SfuServer, feed: int) -> AsyncIterator[Publication]:
        self._pin = secrets.token_urlsafe(12)
        async with (
            open_janus(station.url.address) as session,
            publish(session, self._room_of(station), self._endpoint, self._media, feed, self._codec) as publication,
            background_tasks(_end_with(session, publication)),
        ):
            yield publication

    @asynccontextmanager
    async def pass_on(
        self, origin: SfuServer, station: SfuServer, publication: Publication
    ) -> AsyncIterator[JanusSession]:
        """Feed `station` from `origin` while entered."""
        name = f"{station.name}-{secrets.token_hex(4)}"
        async with open_janus(station.url.address) as session, open_janus(origin.url.address) as there:
            handle, sender = await session.attach(_ignore), await there.attach(_ignore)
            room, first = self._room_of(station)(session), self._room_of(origin)(there)
            await room.prepare(handle)
            inlet = await room.receive_from(handle, publication.feed, publication.streams)
            await first.send_to(sender, publication.feed, name, station.url.host, inlet)
            try:
                yield session
            finally:
                if not there.ended.is_set():
                    await _quietly(first.stop_sending(sender, publication.feed, name))
                if not session.ended.is_set():
                    await _quietly(room.forget(handle, publication.feed))

    def ticket(self, station: SfuServer) -> RelayTicket:
        return RelayTicket(
            relay=station.name,
            url=station.public,
            room=station.url.room,
            pin=self._pin,
            feed=station.feed,
            streams=list(station.streams),
        )

    def _room_of(self, station: SfuServer) -> Callable[[JanusSession], JanusRoom]:
        number = station.url.room
        place = f"{station.url.address}/{number}"
        keys = RoomKeys(self._admin_key, self._derived("secret", place), self._derived("publisher", place), self._pin)
        return lambda session: JanusRoom(session, number, keys)

    def _derived(self, purpose: str, place: str) -> str:
        return hmac.new(self._key, f"relay {purpose} {place}".encode(), hashlib.sha256).hexdigest()[:32]


async def _end_with(session: JanusSession, publication: Publication) -> None:
    await session.ended.wait()
    publication.end(session.why)


def _ignore(_: object) -> None:
    """Ignore events on a handle for administration."""


async def _quietly(request: Awaitable[None]) -> None:
    with suppress(RelayError):
        await request
