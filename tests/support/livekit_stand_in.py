"""What stands in for a LiveKit server in tests: no server of theirs can be had here.

It speaks the signalling of LiveKit's protocol, version 0 (`/rtc`, two peer connections), as far as LiveKit's own
clients need it to publish and to subscribe, and forwards packets between them as they are: what a real one does to
them (bandwidth, layers, retransmission, trailers) is not shown by it. The clients on both sides are the real ones.
"""

import asyncio
import itertools
import json
import re
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit

import jwt
from aiortc import RTCConfiguration, RTCDataChannel, RTCPeerConnection, RTCSessionDescription
from aiortc.rtp import HeaderExtensionsMap, RtcpPsfbPacket, RtpPacket
from aiortc.sdp import candidate_from_sdp
from livekit.protocol import models, rtc
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from server.data_transport_private import tune_data_transport
from server.media.publishing_private import offer_section

__all__ = ["KEY", "SECRET", "LiveKitStandIn", "Member", "livekit_stand_in"]

KEY, SECRET = "test-key", "only for tests: a secret of 32 bytes or more"
PLI = 1


@dataclass
class Track:
    """One that is published."""

    info: Any
    cid: str  # its id in the publisher's descriptions
    ssrc: int = 0
    codec: str = ""  # "H264", "VP8"


@dataclass(eq=False)
class Member:
    """One client in a room."""

    socket: ServerConnection
    claims: dict[str, Any]
    sid: str
    publishing: RTCPeerConnection
    subscribing: RTCPeerConnection
    tracks: list[Track] = field(default_factory=list)
    channels: dict[str, RTCDataChannel] = field(default_factory=dict)  # towards it
    outlets: dict[str, Any] = field(default_factory=dict)  # transceivers, by sid of the track
    offered: bool = False  # and not answered yet
    outdated: bool = False  # what was offered
    wanted: set[str] = field(default_factory=set)  # sids of tracks that it asked for

    @property
    def identity(self) -> str:
        return str(self.claims["sub"])

    @property
    def room(self) -> str:
        return str(self.claims["video"]["room"])

    def info(self) -> Any:
        hidden = bool(self.claims["video"].get("hidden"))
        return models.ParticipantInfo(
            sid=self.sid,
            identity=self.identity,
            state=models.ParticipantInfo.ACTIVE,
            tracks=[track.info for track in self.tracks],
            is_publisher=bool(self.tracks),
            permission=models.ParticipantPermission(
                can_subscribe=bool(self.claims["video"].get("canSubscribe", True)),
                can_publish=bool(self.claims["video"].get("canPublish", True)),
                can_publish_data=bool(self.claims["video"].get("canPublishData", True)),
                hidden=hidden,
            ),
        )

    async def say(self, **fields: Any) -> None:
        with suppress(ConnectionClosed):
            await self.socket.send(rtc.SignalResponse(**fields).SerializeToString())


class LiveKitStandIn:
    """`members`: those who are in; `refused`: tokens that were not good."""

    def __init__(self) -> None:
        self.url = ""
        self.members: list[Member] = []
        self.claims: list[dict[str, Any]] = []  # of everybody who came in
        self.refused = 0
        self.accepts = True  # False: as if it were overloaded
        self.payloads: Callable[[str, RtpPacket], None] = lambda _name, _packet: None
        self.data: list[tuple[str, bytes]] = []  # topic and payload, the last ones
        self._changed = asyncio.Event()
        self._numbers = itertools.count(1)
        self._tasks: set[asyncio.Task[None]] = set()

    async def until(self, holds: Callable[[], bool], seconds: float = 15.0) -> None:
        async with asyncio.timeout(seconds):
            while not holds():
                self._changed.clear()
                await self._changed.wait()

    def tell(self) -> None:
        self._changed.set()

    # Signalling

    def admit(self, _: ServerConnection, request: Request) -> Response | None:
        """Only who has a good token; and only version 0."""
        if self._claims_of(request) is None:
            self.refused += 1
            return _no(HTTPStatus.UNAUTHORIZED)
        if not self.accepts:
            return _no(HTTPStatus.SERVICE_UNAVAILABLE)
        return None if urlsplit(request.path).path == "/rtc" else _no(HTTPStatus.NOT_FOUND)

    @staticmethod
    def _claims_of(request: Request) -> dict[str, Any] | None:
        bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
        token = bearer or parse_qs(urlsplit(request.path).query).get("access_token", [""])[0]
        try:
            claims: dict[str, Any] = jwt.decode(
                token, SECRET, algorithms=["HS256"], issuer=KEY, options={"require": ["exp", "nbf", "sub"]}
            )
        except jwt.PyJWTError:
            return None
        return claims if claims.get("video", {}).get("roomJoin") else None

    async def serve(self, socket: ServerConnection) -> None:
        """One client, until it goes."""
        request = socket.request
        claims = None if request is None else self._claims_of(request)
        if claims is None:
            return
        bundle = RTCConfiguration(iceServers=[])
        member = Member(
            socket, claims, f"PA_{next(self._numbers)}", RTCPeerConnection(bundle), RTCPeerConnection(bundle)
        )
        self.claims.append(claims)
        others = [each.info() for each in self._room(member)]
        self.members.append(member)
        self._take_data(member)
        await member.say(
            join=rtc.JoinResponse(
                room=models.Room(sid=f"RM_{member.room}", name=member.room),
                participant=member.info(),
                other_participants=others,
                server_version="0.0.0",
                server_info=models.ServerInfo(version="0.0.0", protocol=16, node_id="stand-in"),
                subscriber_primary=bool(claims["video"].get("canSubscribe", True)),
                ping_timeout=15,
                ping_interval=5,
            )
        )
        self.tell()
        try:
            if claims["video"].get("canSubscribe", True):
                await self._offer(member)
            async for data in socket:
                if isinstance(data, bytes):
                    asked = rtc.SignalRequest()
                    asked.ParseFromString(data)
                    await self._heed(member, asked)
        except ConnectionClosed:
            pass
        finally:
            self.members.remove(member)
            await asyncio.gather(member.publishing.close(), member.subscribing.close())
            self.tell()

    def _room(self, member: Member) -> list[Member]:
        return [each for each in self.members if each.room == member.room and each is not member]

    async def _heed(self, member: Member, asked: Any) -> None:
        kind = asked.WhichOneof("message")
        if kind == "offer":
            await self._answer(member, asked.offer)
        elif kind == "answer":
            await member.subscribing.setRemoteDescription(RTCSessionDescription(asked.answer.sdp, "answer"))
            member.offered = False
            if member.outdated:
                await self._offer(member)
        elif kind == "trickle":
            await self._trickle(member, asked.trickle)
        elif kind == "subscription":
            member.wanted |= set(asked.subscription.track_sids) if asked.subscription.subscribe else set()
            await self._offer(member)
        elif kind == "add_track":
            await self._add_track(member, asked.add_track)
        elif kind == "ping_req":
            await member.say(pong_resp=rtc.Pong(last_ping_timestamp=asked.ping_req.timestamp, timestamp=1))
        elif kind == "ping":
            await member.say(pong=asked.ping)

    async def _trickle(self, member: Member, trickle: Any) -> None:
        pc = member.subscribing if trickle.target == rtc.SUBSCRIBER else member.publishing
        init = json.loads(trickle.candidateInit or "{}")
        text = str(init.get("candidate", ""))
        if not text.startswith("candidate:") or " udp " not in text.lower() or pc.remoteDescription is None:
            return
        candidate = candidate_from_sdp(text.removeprefix("candidate:"))
        candidate.sdpMid, candidate.sdpMLineIndex = init.get("sdpMid"), init.get("sdpMLineIndex")
        with suppress(Exception):  # of a section that is bundled
            await pc.addIceCandidate(candidate)

    async def _add_track(self, member: Member, asked: Any) -> None:
        info = models.TrackInfo(
            sid=f"TR_{next(self._numbers)}",
            type=asked.type,
            name=asked.name,
            width=asked.width,
            height=asked.height,
            source=asked.source,
            layers=asked.layers,
            stream=asked.stream,
            packet_trailer_features=asked.packet_trailer_features,
        )
        member.tracks.append(Track(info, asked.cid))
        await member.say(track_published=rtc.TrackPublishedResponse(cid=asked.cid, track=info))

    # The publisher

    async def _answer(self, member: Member, offer: Any) -> None:
        pc = member.publishing
        _find_ssrcs(offer.sdp, member.tracks)
        await pc.setRemoteDescription(RTCSessionDescription(offer.sdp, "offer"))
        for transceiver in pc.getTransceivers():
            transceiver.direction = "recvonly"
            receiver: Any = transceiver.receiver
            receiver.receive = _nothing  # nothing is decoded here
        await pc.setLocalDescription(await pc.createAnswer())

        async def take(data: bytes, arrival_time_ms: int) -> None:
            self._forward(member, RtpPacket.parse(data, HeaderExtensionsMap()))

        for transceiver in pc.getTransceivers():
            transport: Any = transceiver.receiver.transport
            transport._handle_rtp_data = take
        answer = pc.localDescription
        await member.say(answer=rtc.SessionDescription(type="answer", sdp=answer.sdp, id=offer.id))
        for other in self._room(member):
            await other.say(update=rtc.ParticipantUpdate(participants=[member.info()]))
            if member.tracks and other.claims["video"].get("canSubscribe", True):
                await self._offer(other)
        self.tell()

    def _take_data(self, member: Member) -> None:
        def opened(channel: RTCDataChannel) -> None:
            channel.on("message", lambda data: self._pass_on(member, channel.label, data))

        member.publishing.on("datachannel", opened)

    def _pass_on(self, member: Member, label: str, data: bytes) -> None:
        packet = models.DataPacket()
        packet.ParseFromString(data)
        packet.participant_identity, packet.participant_sid = member.identity, member.sid
        self.data = [*self.data[-99:], (packet.user.topic, bytes(packet.user.payload))]
        for other in self._room(member):
            channel = other.channels.get(label)
            if channel is not None and channel.readyState == "open":
                channel.send(packet.SerializeToString())
        self.tell()

    def _forward(self, member: Member, packet: RtpPacket) -> None:
        track = next((each for each in member.tracks if each.ssrc == packet.ssrc), None)
        if track is None:
            return
        self.payloads(track.info.name, packet)
        for other in self._room(member):
            outlet = other.outlets.get(track.info.sid)
            if outlet is not None:
                self._later(_send(outlet, packet))
        self.tell()

    def ask_for_keyframe(self) -> None:
        """Of everything that is published."""
        for member in self.members:
            for track in member.tracks:
                packet = RtcpPsfbPacket(fmt=PLI, ssrc=1, media_ssrc=track.ssrc)
                transceivers = member.publishing.getTransceivers()
                if transceivers:
                    transport: Any = transceivers[-1].receiver.transport
                    self._later(_send_control(transport, packet))

    # Those who watch

    async def _offer(self, member: Member) -> None:
        pc = member.subscribing
        member.outdated = member.offered
        if member.offered or pc.connectionState == "closed":
            return
        member.offered = True
        if not member.channels:
            member.channels["_lossy"] = pc.createDataChannel("_lossy", ordered=False, maxRetransmits=0)
            member.channels["_reliable"] = pc.createDataChannel("_reliable")
            tune_data_transport(pc)
        for other in self._room(member):
            for track in other.tracks:
                if track.codec and track.info.sid in member.wanted - set(member.outlets):
                    transceiver = offer_section(pc, "video", track.codec)
                    sender: Any = transceiver.sender
                    sender._stream_id, sender._track_id = f"{other.sid}|{track.info.sid}", track.info.sid
                    sender._send_keyframe = self.ask_for_keyframe
                    member.outlets[track.info.sid] = transceiver
        await pc.setLocalDescription(await pc.createOffer())
        await member.say(offer=rtc.SessionDescription(type="offer", sdp=pc.localDescription.sdp, id=1))

    def _later(self, coroutine: Any) -> None:
        task = asyncio.get_running_loop().create_task(coroutine)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def _no(status: HTTPStatus) -> Response:
    """Pages of another origin may read it."""
    headers = Headers({"Access-Control-Allow-Origin": "*", "Content-Length": str(len(status.phrase))})
    return Response(status.value, status.phrase, headers, status.phrase.encode())


async def _nothing(parameters: Any) -> None:
    """Instead of a receiver's own work."""


async def _send(outlet: Any, packet: RtpPacket) -> None:
    sender = outlet.sender
    if sender.transport is None or sender.transport.state != "connected":
        return
    copy = RtpPacket(
        payload_type=outlet._codecs[0].payloadType,
        marker=packet.marker,
        sequence_number=packet.sequence_number,
        timestamp=packet.timestamp,
        ssrc=sender._ssrc,
        payload=packet.payload,
    )
    with suppress(ConnectionError):
        await sender.transport._send_rtp(copy.serialize(HeaderExtensionsMap()))


async def _send_control(transport: Any, packet: RtcpPsfbPacket) -> None:
    with suppress(ConnectionError):
        await transport._send_rtp(bytes(packet))


def _find_ssrcs(sdp: str, tracks: list[Track]) -> None:
    """Each section of the offer names the track's id, its codec and its first source."""
    for section in sdp.split("\r\nm=")[1:]:
        named = re.search(r"a=msid:\S+ (\S+)", section)
        source = re.search(r"a=ssrc:(\d+) ", section)
        codec = re.search(r"a=rtpmap:\d+ (\w+)/", section)
        if named is not None and source is not None and codec is not None:
            for track in tracks:
                if track.cid == named[1]:
                    track.ssrc, track.codec = int(source[1]), codec[1]


@asynccontextmanager
async def livekit_stand_in(host: str = "127.0.0.1") -> AsyncIterator[LiveKitStandIn]:
    """Its signalling listens on `host`; media go by the machine's other addresses, which ICE offers."""
    stand_in = LiveKitStandIn()
    async with serve(stand_in.serve, host, 0, process_request=stand_in.admit, max_size=2**20) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        stand_in.url = f"ws://{host}:{port}"
        yield stand_in
        for member in list(stand_in.members):
            await member.socket.close()
    await stand_in.close()
