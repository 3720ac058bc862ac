"""One WHEP connection to a console: connection, data channels, received streams."""

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from lockstep.client.console_url import ConsoleLink
from lockstep.client.errors import ConnectFailed, ConsoleError, SignallingRefused
from lockstep.client.transport.endpoints import open_endpoint
from lockstep.client.transport.media_sections import receiving
from lockstep.client.transport.packets import EXTENSION_URIS, Packets
from lockstep.client.transport.sdp import Section, read_sections
from lockstep.client.transport.transport import ChannelName
from lockstep.client.transport.whep import Whep
from lockstep.protocol.carriers import Carrier
from lockstep.protocol.console import ClientMessage, encode_console_message
from lockstep.rtc.channels import ChannelClosed, ChannelMessage, ChannelNotOpen, ChannelOpened
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.endpoint import Connection, Endpoint
from lockstep.rtc.interfaces import own_addresses
from lockstep.rtc.peer import OfferedMedia, PeerNotReady
from lockstep.rtc.peer_events import PeerEnded, PeerEvent, Restarted, RestartFailed
from lockstep.rtc.sctp import AssociationClosed, SendQueueFull
from lockstep.rtc.sdp import SdpError, parse_description, parse_fragment, write_description, write_fragment
from lockstep.rtc.turn.servers import IceServer

__all__ = ["WebRtcTransport", "Route"]

CHANNELS: Mapping[ChannelName, Reliability] = {
    "control": Reliability(ordered=False, max_retransmits=0),
    "session": Reliability(),
    "stop": Reliability(),
}
CLOSE_SECONDS = 3.0
LOOPBACK = "127.0.0.1"
ENDS = {
    "consent_expired": "the console did not answer for 30 s",
    "no_path": "no path to the console was found: is UDP to the console blocked?",
}  # any other: the console closed the connection


class Route(Protocol):
    """Changes the descriptions on their way, so that the connection passes a forwarder."""

    def offer(self, sdp: str) -> str: ...

    def answer(self, sdp: str) -> str: ...


class WebRtcTransport:
    """A `Transport` by WebRTC, for messages and media."""

    def __init__(
        self,
        link: ConsoleLink,
        *,
        carrier: Carrier,
        video: int,
        audio: bool,
        codec: str | None,
        route: Route | None,
        tls_ca: Path | None,
        relay_only: bool,
        on_message: Callable[[str | bytes], None],
        relay: str = "",
        sound_codec: str | None = None,
    ) -> None:
        self.whep = Whep(link, tls_ca)
        self.packets: Packets | None = None
        self.ended = asyncio.Event()
        self.why = ""  # reason that the connection ended
        self.reliable = False
        self.skipped = 0  # messages on `control` that found others waiting
        self._link = link
        self._carrier = carrier
        self._route = route
        self._on_message = on_message
        self._relay_only = relay_only
        self._relay = relay  # the relay that media come from; "": the console
        self._ice_servers: list[IceServer] = []
        self._resource = ""
        self._answer = ""
        self._closing = False
        uri = EXTENSION_URIS.get(carrier)
        media = [("video", receiving("video", codec, uri))] * video
        media += [("audio", receiving("audio", sound_codec, uri))] * audio
        self._offered = [OfferedMedia(str(number), kind, own) for number, (kind, own) in enumerate(media)]
        self._endpoint: Endpoint | None = None
        self._connection: Connection | None = None
        self._channels: dict[ChannelName, int] = {}
        self._open: set[int] = set()  # channels
        self._stepped = asyncio.Event()  # a channel opened, or the connection ended
        self._restarted: asyncio.Future[bool] | None = None  # while ICE is restarted

    def _hosts(self) -> list[str]:
        if self._relay_only:
            return []
        return [LOOPBACK] if self._link.loopback else own_addresses()

    def _happened(self, event: PeerEvent) -> None:
        match event:
            case ChannelMessage(data=data):
                self._on_message(data)
            case ChannelOpened(channel=channel):
                self._open.add(channel)
                self._stepped.set()
            case ChannelClosed(channel=channel):
                self._open.discard(channel)
                name = next((name for name, number in self._channels.items() if number == channel), "")
                self.lose(f"the console closed the channel {name}")
            case PeerEnded(reason=reason):
                self.lose(ENDS.get(reason, "the console closed the connection"))
            case Restarted() | RestartFailed():
                if self._restarted is not None and not self._restarted.done():
                    self._restarted.set_result(isinstance(event, Restarted))
            case _:
                if self.packets is not None:
                    self.packets.heard(event)

    def lose(self, why: str) -> None:
        """Count the connection as lost; the first reason stands."""
        if not self._closing and not self.ended.is_set():
            self.why = why
            self.ended.set()
            self._stepped.set()

    async def negotiate(self) -> list[Section]:
        """Send an offer and take the answer; return its media sections.

        Raises:
            SignallingRefused, ConnectFailed: as `Whep.offer`.
            ConnectFailed: also when only relays may be used, and none gives an address.
        """
        self._ice_servers = await self.whep.ice_servers()
        endpoint = self._endpoint = open_endpoint(self._hosts())
        await self._ask_servers(endpoint)
        connection = self._connection = endpoint.connect(controlling=True, listener=self._happened)
        connection.urgent = True  # a command waits for no turn of the loop: nothing else leaves from this endpoint
        self.packets = Packets(connection, self._carrier)
        sdp = write_description(connection.offer(self._offered))
        sent = sdp if self._route is None else self._route.offer(sdp)
        answer = await self.whep.offer(sent, trailer=self._carrier == "trailer", relay=self._relay)
        self._resource = answer.resource
        self._answer = answer.sdp if self._route is None else self._route.answer(answer.sdp)
        return read_sections(self._answer)

    async def _ask_servers(self, endpoint: Endpoint) -> None:
        troubles = await endpoint.ask(self._ice_servers)
        if self._relay_only and not endpoint.candidates:
            why = "; ".join(map(str, troubles)) or "the console names no TURN server"
            raise ConnectFailed(f"no TURN server gave an address: {why}")

    def _need_connection(self) -> Connection:
        if self._connection is None:
            raise RuntimeError("call negotiate() first")
        return self._connection

    async def connect(self, seconds: float) -> None:
        """Connect; return when the data channels are open.

        Raises:
            ConnectFailed: no way to the console over UDP was found within `seconds`.
        """
        connection = self._need_connection()
        try:
            connection.accept(parse_description(self._answer))
            self._channels = {name: connection.open_channel(name, reliability=CHANNELS[name]) for name in CHANNELS}
        except (SdpError, PeerNotReady) as error:
            raise ConnectFailed(f"the console's answer cannot be used: {error}") from error
        try:
            async with asyncio.timeout(seconds):
                while not self.ended.is_set() and not self._open >= set(self._channels.values()):
                    self._stepped.clear()
                    await self._stepped.wait()
        except TimeoutError:
            detail = "no data channel was open in time: is UDP to the console blocked?"
            raise ConnectFailed(detail) from None
        if self.ended.is_set():
            raise ConnectFailed(self.why)

    async def run(self) -> None:
        await self.ended.wait()  # the endpoint does the work

    def send(self, channel: ChannelName, message: ClientMessage) -> None:
        """Send a message. On `control`, drop it if others wait: an old command must not leave after a newer one."""
        connection, number = self._connection, self._channels.get(channel)
        if connection is None or number is None or number not in self._open or self.ended.is_set():
            return
        channels = connection.peer.channels
        if channel == "control" and channels is not None and channels.association.has_waiting(number):
            self.skipped += 1
            return
        try:
            connection.send(number, encode_console_message(message))
        except (PeerNotReady, ChannelNotOpen, AssociationClosed):
            pass  # it has just ended, and an event says so
        except SendQueueFull:
            self.lose("the console accepts no messages any more")

    async def restart_ice(self, seconds: float) -> None:
        """Look for a new path to the console; channels and media live on, and move to it when it is found.

        Raises:
            SignallingRefused: the console does not restart this session, or it has ended.
            ConnectFailed: no other path was found within `seconds`; the old one stays.
        """
        connection, endpoint = self._need_connection(), self._endpoint
        if endpoint is None:
            raise RuntimeError("call negotiate() first")
        if self.ended.is_set():
            raise SignallingRefused(404, "not_found", self.why)  # as the console would say
        if self._ice_servers:  # their credentials may have ended
            self._ice_servers = await self.whep.ice_servers()
        restarted = self._restarted = asyncio.get_running_loop().create_future()
        try:
            async with asyncio.timeout(seconds):
                endpoint.use_hosts(self._hosts())
                await self._ask_servers(endpoint)
                await self._signal_restart(connection)
                found = await restarted
        except (ValueError, PeerNotReady, TimeoutError) as error:
            raise ConnectFailed(f"no new path to the console: {error or 'none was found in time'}") from error
        finally:
            self._restarted = None
            if not (restarted.done() and not restarted.cancelled() and restarted.result()):
                connection.cancel_restart()
        if not found:
            raise ConnectFailed("no new path to the console")

    async def _signal_restart(self, connection: Connection) -> None:
        section = connection.peer.negotiation.tagged
        fragment = write_fragment(connection.restart(), section.kind, section.mid)
        sent = fragment if self._route is None else self._route.offer(fragment)
        answer = await self.whep.restart_ice(self._resource, sent)
        answer = answer if self._route is None else self._route.answer(answer)
        connection.accept_restart(parse_fragment(answer, section.mid))

    async def close(self) -> None:
        """End the connection and say so to the console. Idempotent."""
        if self._closing:
            return
        self._closing = True
        self.ended.set()
        try:
            async with asyncio.timeout(CLOSE_SECONDS):
                if self._resource:
                    await self.whep.end(self._resource)
        except (TimeoutError, ConsoleError):
            pass  # the console ends the session when no packet arrives any more
        finally:
            if self._endpoint is not None:
                self._endpoint.close()
            await self.whep.aclose()
