"""One WHEP connection to a console: peer connection, data channels, received streams."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Literal, Protocol

from aiortc import (
    RTCBundlePolicy,
    RTCConfiguration,
    RTCDataChannel,
    RTCIceGatherer,
    RTCIceServer,
    RTCIceTransportPolicy,
    RTCPeerConnection,
    RTCSessionDescription,
)
from aiortc.rtcrtpparameters import RTCRtpCodecCapability
from aiortc.rtcrtpreceiver import RTCRtpReceiver

from client.aiortc_private import (
    PacketSink,
    drain_dtls,
    gather_only_on,
    hasten_sctp,
    keep_path,
    send_control,
    take_packets,
    take_raw_rtp,
    tell_data_from_stun,
    use_ice_servers,
)
from client.errors import ConnectFailed, ConsoleError
from client.finish import within
from client.ice_restart_private import IceRestart
from client.link import ConsoleLink
from client.relay import RelayTicket
from client.sdp import Section, offer_extension, read_sections
from client.whep import Whep
from robot_bridge.protocol.carriers import (
    CAPTURE_TIME_URI,
    EVENT_REFERENCE_URI,
    Carrier,
    unpack_capture_time,
    unpack_event_reference,
)
from robot_bridge.protocol.console import ClientMessage, encode_console_message
from robot_bridge.protocol.messages import StopTaken

__all__ = ["ChannelName", "Peer", "Route", "stamp_reader"]

ChannelName = Literal["control", "session", "stop"]
CHANNELS: tuple[ChannelName, ...] = ("control", "session", "stop")
CONTROL_BACKLOG = 4096  # bytes; a message on `control` is worth nothing behind so many others
CLOSE_SECONDS = 3.0
CODECS = {"video": ("VP8", "H264"), "audio": ("opus", "PCMU")}
EXTENSION_URIS: dict[Carrier, str] = {"native": EVENT_REFERENCE_URI, "capture-time": CAPTURE_TIME_URI}


class Route(Protocol):
    """Changes the descriptions on their way, so that the connection passes a relay."""

    def offer(self, sdp: str) -> str: ...

    def answer(self, sdp: str) -> str: ...


def stamp_reader(carrier: Carrier) -> Callable[[bytes], int | None]:
    """How to read the header extension of `carrier`."""
    return unpack_capture_time if carrier == "capture-time" else unpack_event_reference


class Peer:
    """Order: `connect`, then `send` until `ended` is set, then `close`."""

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
        self.ended = asyncio.Event()
        self.why = ""  # the connection ended
        self.skipped = 0  # messages on `control` that found others waiting
        self._link = link
        self._carrier = carrier
        self._route = route
        self._on_message = on_message
        self._relay_only = relay_only
        self._relay = relay  # that media come from; "": from the console
        self._ice_servers: list[RTCIceServer] = []
        self._whep = Whep(link, tls_ca)
        self._resource = ""
        self._closing = False
        tell_data_from_stun()
        self._pc = RTCPeerConnection(RTCConfiguration(iceServers=[], bundlePolicy=RTCBundlePolicy.MAX_BUNDLE))
        self._stepped = asyncio.Event()  # a channel opened, or the connection ended
        for _ in range(video):
            transceiver = self._pc.addTransceiver("video", direction="recvonly")
            if codec is not None:
                transceiver.setCodecPreferences(_preferred("video", codec))
        if audio:
            transceiver = self._pc.addTransceiver("audio", direction="recvonly")
            if sound_codec is not None:
                transceiver.setCodecPreferences(_preferred("audio", sound_codec))
        self._channels = {name: self._create_channel(name) for name in CHANNELS}
        self._pc.on("connectionstatechange", self._state_changed)

    @property
    def _gather_on(self) -> list[str] | None:
        """aioice never looks at loopback by itself; None: where it does look."""
        return ["127.0.0.1"] if self._link.loopback and not self._relay_only else None

    def _create_channel(self, name: ChannelName) -> RTCDataChannel:
        if name == "control":
            channel = self._pc.createDataChannel(name, ordered=False, maxRetransmits=0)
        else:
            channel = self._pc.createDataChannel(name)
        channel.on("open", self._stepped.set)
        channel.on("message", self._on_message)
        channel.on("close", lambda: self.lose(f"the console closed the channel {name}"))
        return channel

    def _state_changed(self) -> None:
        if self._pc.connectionState in ("failed", "closed"):
            self.lose("the console closed the connection")

    def lose(self, why: str) -> None:
        """Count the connection as lost; the first reason stands."""
        if not self._closing and not self.ended.is_set():
            self.why = why
            self.ended.set()
            self._stepped.set()

    async def relay_ticket(self, peer: str = "") -> RelayTicket | None:
        """Where the console wants this observer to watch; raises as `negotiate`."""
        return await self._whep.relay(peer)

    async def negotiate(self) -> list[Section]:
        """Offer, and take the answer: its media sections.

        Raises:
            SignallingRefused, ConnectFailed: as `Whep.offer`.
        """
        self._ice_servers = await self._whep.ice_servers()
        use_ice_servers(self._pc, self._ice_servers, relay_only=self._relay_only)
        if self._gather_on is not None:
            gather_only_on(self._pc, self._gather_on)
        keep_path(self._pc, lambda: self.lose("the console answered nothing for 30 s"))
        hasten_sctp(self._pc)
        drain_dtls(self._pc)
        offer = await self._pc.createOffer()
        uri = EXTENSION_URIS.get(self._carrier)
        await self._pc.setLocalDescription(RTCSessionDescription(offer_extension(offer.sdp, uri), "offer"))
        sdp = self._pc.localDescription.sdp
        sent = sdp if self._route is None else self._route.offer(sdp)
        answer = await self._whep.offer(sent, trailer=self._carrier == "trailer", relay=self._relay)
        self._resource = answer.resource
        self._answer = answer.sdp if self._route is None else self._route.answer(answer.sdp)
        return read_sections(self._answer)

    def extension_id(self, sections: list[Section]) -> int | None:
        """The id under which the console sends the carrier's header extension."""
        uri = EXTENSION_URIS.get(self._carrier)
        return next((section.extensions[uri] for section in sections if uri and uri in section.extensions), None)

    def take_packets(self, sinks: dict[str, PacketSink], extension_id: int | None) -> None:
        """Give packets to the sink of their section's mid. Between `negotiate` and `connect`."""
        take_packets(self._pc, sinks, extension_id, stamp_reader(self._carrier))

    def take_raw_rtp(self, take: Callable[[bytes], None], control: Callable[[bytes], None]) -> None:
        """Give every RTP packet to `take`, and nothing to anybody else. Between `negotiate` and `connect`."""
        take_raw_rtp(self._pc, take, control)

    async def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet, if the connection is up."""
        await send_control(self._pc, packet)

    async def connect(self, seconds: float) -> None:
        """Connect; returns when the data channels are open.

        Raises:
            ConnectFailed: no way to the console over UDP within `seconds`.
        """
        try:
            await self._pc.setRemoteDescription(RTCSessionDescription(self._answer, "answer"))
        except ValueError as error:
            raise ConnectFailed(f"the console's answer cannot be read: {error}") from error
        try:
            async with asyncio.timeout(seconds):
                while not self.ended.is_set() and any(each.readyState != "open" for each in self._channels.values()):
                    self._stepped.clear()
                    await self._stepped.wait()
        except TimeoutError:
            detail = f"no data channel after {seconds:g} s: is UDP between here and the console blocked?"
            raise ConnectFailed(detail) from None
        if self.ended.is_set():
            raise ConnectFailed(self.why)

    def send(self, channel: ChannelName, message: ClientMessage) -> None:
        """Send; on `control`, unless others still wait: an old command must not leave behind a newer one."""
        target = self._channels[channel]
        if target.readyState != "open":
            return
        if channel == "control" and target.bufferedAmount > CONTROL_BACKLOG:
            self.skipped += 1
            return
        target.send(encode_console_message(message))

    async def restart_ice(self, seconds: float) -> None:
        """Look for a new path to the console; channels and media live on, and move to it when it is found.

        Raises:
            SignallingRefused: the console does not restart this session.
            ConnectFailed: no other path within `seconds`; the old one is as it was.
        """
        first = read_sections(self._answer)[0]
        if self._ice_servers:  # their credentials may have ended
            self._ice_servers = await self._whep.ice_servers()
        policy = RTCIceTransportPolicy.RELAY if self._relay_only else RTCIceTransportPolicy.ALL
        restart = IceRestart(self._pc, RTCIceGatherer(self._ice_servers, policy), self._gather_on)
        try:
            async with asyncio.timeout(seconds):
                await restart.gather()
                fragment = restart.fragment(first.kind, first.mid)
                sent = fragment if self._route is None else self._route.offer(fragment)
                answer = await self._whep.restart_ice(self._resource, sent)
                await restart.connect(answer if self._route is None else self._route.answer(answer))
        except (ValueError, ConnectionError, TimeoutError) as error:
            raise ConnectFailed(f"no new path to the console: {error or 'none within the time'}") from error
        finally:
            await restart.close()

    async def stop_by_http(self, reason: str, press: str) -> StopTaken:
        """The way to stop that needs no data channel; raises as `Whep.stop`."""
        return await self._whep.stop(reason, press)

    async def close(self) -> None:
        """End the connection and say so to the console. Idempotent."""
        if self._closing:
            return
        self._closing = True
        self.ended.set()
        try:
            async with asyncio.timeout(CLOSE_SECONDS):
                if self._resource:
                    await self._whep.end(self._resource)
        except (TimeoutError, ConsoleError):
            pass  # it ends the session by itself when nothing arrives any more
        finally:
            await within(CLOSE_SECONDS, self._pc.close())
            await self._whep.aclose()


def _preferred(kind: Literal["video", "audio"], codec: str) -> list[RTCRtpCodecCapability]:
    """The capabilities with `codec` alone, and its retransmissions."""
    if codec not in CODECS[kind]:
        raise ValueError(f"no codec {codec}; there are {' and '.join(CODECS[kind])}")
    capabilities = RTCRtpReceiver.getCapabilities(kind)
    known = capabilities.codecs if capabilities is not None else []
    names = {f"{kind}/{codec}".lower(), f"{kind}/rtx"}
    return [capability for capability in known if capability.mimeType.lower() in names]
