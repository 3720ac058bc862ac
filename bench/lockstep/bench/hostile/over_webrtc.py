"""Attacks on a console by a peer with an observer's link that speaks WebRTC."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from random import Random
from typing import Any

import httpx
from aioice import stun
from aiortc import RTCConfiguration, RTCDataChannel, RTCPeerConnection, RTCSessionDescription
from aiortc.rtp import RtcpReceiverInfo, RtcpRrPacket, RtpPacket
from aiortc.sdp import SessionDescription

from lockstep.bench.harness.aioice_hosts import use_hosts
from lockstep.bench.hostile.target import Target
from lockstep.protocol.console import decode_server_message, encode_console_message
from lockstep.protocol.messages import Command, Feedback, Ping, Reset, Rest

__all__ = [
    "forged_commands",
    "garbage_datagrams",
    "garbage_messages",
    "half_open",
    "many_sections",
    "media_flood",
    "message_flood",
    "reset_spam",
    "restart_flood",
    "slow_reader",
    "stun_flood",
]

SDP = "application/sdp"
FRAGMENT = "application/trickle-ice-sdpfrag"
STAY = 5.0  # s; longer than the console tolerates any of these
CONNECT_SECONDS = 8.0
BURST = 100


class Peer:
    """A connection that obeys none of the console's rules."""

    def __init__(self) -> None:
        self.pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        self.channels: dict[str, RTCDataChannel] = {}
        self.closed = asyncio.Event()
        self.event = 1  # event of the newest feedback, for forging
        self.issue = 1
        self.nonce = 0
        self.location = ""

    async def join(self, target: Target, *, video: bool = False, speaks: bool = False) -> bool:
        """Connect; False if the console refuses it. `speaks`: as an operator, with a microphone."""
        for label in ("control", "session", "stop"):
            lossy = label == "control"
            channel = self.pc.createDataChannel(label, ordered=not lossy, maxRetransmits=0 if lossy else None)
            channel.on("message", self._heard)
            channel.on("close", self.closed.set)
            self.channels[label] = channel
        if video:
            self.pc.addTransceiver("video", direction="recvonly")
        if speaks:
            self.pc.addTransceiver("audio", direction="sendonly")
        ask = target.ask_as_operator if speaks else target.ask
        answer = await ask("POST", "/whep", await offer_of(self.pc), **{"Content-Type": SDP})
        if answer.status_code != 201:
            return False
        self.location = answer.headers["location"]
        opened = asyncio.Event()
        self.channels["control"].on("open", opened.set)
        await self.pc.setRemoteDescription(RTCSessionDescription(answer.text, "answer"))
        async with asyncio.timeout(CONNECT_SECONDS):
            await opened.wait()
        return True

    def send(self, label: str, data: str | bytes) -> None:
        channel = self.channels[label]
        if channel.readyState == "open" and channel.bufferedAmount < 1 << 20:
            channel.send(data)

    def _heard(self, data: str) -> None:
        message = decode_server_message(data)
        if isinstance(message, Feedback):
            self.event, self.issue, self.nonce = message.event, message.issue, message.nonce


async def offer_of(pc: RTCPeerConnection) -> str:
    use_hosts(["127.0.0.1"])
    await pc.setLocalDescription(await pc.createOffer())
    return pc.localDescription.sdp


@asynccontextmanager
async def joined(target: Target, *, video: bool = False, speaks: bool = False) -> AsyncIterator[Peer | None]:
    """Connect a peer; None if the console refused it, which is counted."""
    peer = Peer()
    try:
        yield peer if await peer.join(target, video=video, speaks=speaks) else None
    finally:
        await peer.pc.close()


async def _until_thrown_out(peer: Peer, target: Target) -> None:
    try:
        async with asyncio.timeout(STAY):
            await peer.closed.wait()
        target.seen["thrown_out"] += 1
    except TimeoutError:
        target.seen["stayed"] += 1


async def message_flood(target: Target, random: Random) -> None:
    """Send valid messages, many more than a client needs."""
    async with joined(target) as peer:
        if peer is None:
            return
        ping = encode_console_message(Ping(id=1))
        for _ in range(50):
            for _ in range(BURST):
                peer.send("control", ping)
            await asyncio.sleep(0.01)
            if peer.closed.is_set():
                break
        await _until_thrown_out(peer, target)


async def media_flood(target: Target, random: Random) -> None:
    """Send voice many times faster than speech, reports on nothing, and datagrams that only look like SRTP."""
    async with joined(target, speaks=True) as peer:
        if peer is None or peer.pc.sctp is None:
            return
        dtls: Any = peer.pc.sctp.transport
        sender: Any = peer.pc.getSenders()[0]
        reports = [RtcpReceiverInfo(random.getrandbits(32), 0, 0, 0, 0, 0, 0) for _ in range(31)]
        for number in range(2500):
            voice = RtpPacket(payload_type=96, ssrc=sender._ssrc, sequence_number=number, timestamp=960 * number)
            voice.payload = random.randbytes(80)
            with suppress(ConnectionError):  # the console ended the connection
                await dtls._send_rtp(voice.serialize())
                await dtls._send_rtp(bytes(RtcpRrPacket(random.getrandbits(32), reports)))
                await dtls.transport._send(b"\x80\x60" + random.randbytes(100))
            if number % BURST == 0:
                await asyncio.sleep(0.02)
            if peer.closed.is_set():
                break
        target.seen["media_flooded"] += 1


async def garbage_messages(target: Target, random: Random) -> None:
    """Send data that is not a message, on channels that exist and channels that do not."""
    async with joined(target) as peer:
        if peer is None:
            return
        for number in range(30):
            peer.pc.createDataChannel(random.choice(("control", "root", "x" * 200, str(number))))
        for _ in range(20):
            for label in peer.channels:
                size = random.choice((1, 30, 1000, 20_000))
                data = random.randbytes(size)
                peer.send(label, data if random.random() < 0.5 else data.hex()[:size])
            await asyncio.sleep(0.02)
        await _until_thrown_out(peer, target)


async def forged_commands(target: Target, random: Random) -> None:
    """Send commands and rests for the newest event, without the seat."""
    async with joined(target) as peer:
        if peer is None:
            return
        for _ in range(300):
            values = [random.uniform(-1, 1) for _ in range(3)]
            forged = Command(event=peer.event + 1, issue=peer.issue, values=values, nonce=peer.nonce)
            peer.send("control", encode_console_message(forged))
            peer.send("control", encode_console_message(Rest(event=peer.event + 1)))
            await asyncio.sleep(0.01)
            if peer.closed.is_set():
                break
        target.seen["forger_ended"] += 1


async def reset_spam(target: Target, random: Random) -> None:
    """Ask as an observer for the release of the stop, on the channel and over HTTP."""
    async with joined(target) as peer:
        if peer is None:
            return
        for _ in range(100):
            peer.send("stop", encode_console_message(Reset(by="the crowd")))
            await asyncio.sleep(0.01)
        await asyncio.gather(*(target.ask("POST", "/api/reset", '{"number": 1}') for _ in range(5)))


async def slow_reader(target: Target, random: Random) -> None:
    """Ask for pictures and feedback, and then read nothing."""
    async with joined(target, video=True) as peer:
        if peer is None or peer.pc.sctp is None:
            return
        connection: Any = peer.pc.sctp.transport.transport._connection
        connection.data_received = _ignore
        await _until_thrown_out(peer, target)


def _ignore(data: bytes, component: int) -> None:
    """Ignore a datagram."""


async def half_open(target: Target, random: Random) -> None:
    """Send the same offer again and again, and never connect."""
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    try:
        pc.createDataChannel("control")
        pc.addTransceiver("video", direction="recvonly")
        offer = await offer_of(pc)
        for _ in range(10):
            await target.ask("POST", "/whep", offer, **{"Content-Type": SDP})
    finally:
        await pc.close()


async def restart_flood(target: Target, random: Random) -> None:
    """Send ICE restarts and candidates without end."""
    async with joined(target) as peer:
        if peer is None:
            return
        for number in range(40):
            fragment = f"a=ice-ufrag:{number:08d}\r\na=ice-pwd:{random.randbytes(12).hex()}\r\n"
            await target.ask("PATCH", peer.location, fragment, **{"Content-Type": FRAGMENT, "If-Match": "*"})


async def garbage_datagrams(target: Target, random: Random) -> None:
    """Send random datagrams to the ports in an answer: noise, and data that looks like DTLS, RTP and STUN."""
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    try:
        pc.createDataChannel("control")
        answer = await target.ask("POST", "/whep", await offer_of(pc), **{"Content-Type": SDP})
        if answer.status_code != 201:
            return
        await _shower(_ports(answer), random)
    finally:
        await pc.close()


def _ports(answer: httpx.Response) -> list[int]:
    sections = SessionDescription.parse(answer.text).media
    return [candidate.port for section in sections for candidate in section.ice_candidates]


async def _shower(ports: list[int], random: Random) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setblocking(False)
        for _ in range(40):
            for _ in range(BURST // 2):
                first = random.choice((b"", b"\x16\xfe\xfd", b"\x80\x60", b"\0\1\0\0\x21\x12\xa4\x42"))
                data = first + random.randbytes(random.randrange(1, 1400))
                with suppress(OSError):  # the peer was closed, or the socket is full
                    sender.sendto(data, ("127.0.0.1", random.choice(ports)))
            await asyncio.sleep(0.05)


async def many_sections(target: Target, random: Random) -> None:
    """Send complete offers of forty media sections."""
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    try:
        for _ in range(40):
            pc.addTransceiver("video", direction="recvonly")
        await target.ask("POST", "/whep", await offer_of(pc), **{"Content-Type": SDP})
    finally:
        await pc.close()


async def stun_flood(target: Target, random: Random) -> None:
    """Send connectivity checks with false credentials to the port of the attacker's own peer."""
    async with joined(target) as peer:
        if peer is None:
            return
        sections = SessionDescription.parse(peer.pc.remoteDescription.sdp).media
        candidate = next(each for each in sections[0].ice_candidates if each.type == "host")
        request = stun.Message(message_method=stun.Method.BINDING, message_class=stun.Class.REQUEST)
        request.attributes["USERNAME"] = "evil:evil"
        request.add_message_integrity(b"false")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            for _ in range(50):
                for _ in range(BURST):
                    with suppress(OSError):
                        sender.sendto(bytes(request), (candidate.ip, candidate.port))
                await asyncio.sleep(0.02)
        target.seen["stun_sent"] += 50 * BURST
