"""Attacks on a console by a client with an operator's link that publishes a camera (WHIP)."""

import asyncio
import re
import time
from collections.abc import Callable
from random import Random
from typing import Any

from aiortc import RTCConfiguration, RTCPeerConnection, RTCRtpSender, RTCSessionDescription
from aiortc.rtp import RtcpReceiverInfo, RtcpRrPacket, RtpPacket

from lockstep.bench.hostile.over_webrtc import offer_of
from lockstep.bench.hostile.target import Target

__all__ = ["publisher_flood"]

SDP = "application/sdp"
CONNECT_SECONDS = 8.0
FLOOD_SECONDS = 10.0  # of one kind of packet, or until the console has ended the session
BURST = 50  # packets between two looks at the console's answers
PICTURE = bytes((0x10, 0x90, 0x80)) + bytes(1100)  # the first packet of a VP8 picture


async def publisher_flood(target: Target, random: Random) -> None:
    """Send one kind of packet as fast as possible: endless pictures, holes, noise, sources, reports."""
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    try:
        transceiver = pc.addTransceiver("video", direction="sendonly")
        codecs = RTCRtpSender.getCapabilities("video").codecs
        transceiver.setCodecPreferences([each for each in codecs if each.mimeType in ("video/VP8", "video/rtx")])
        answer = await target.publish(await offer_of(pc), **{"Content-Type": SDP})
        if answer.status_code != 201:
            return
        connected = asyncio.Event()
        pc.on("connectionstatechange", lambda: connected.set() if pc.connectionState == "connected" else None)
        await pc.setRemoteDescription(RTCSessionDescription(answer.text, "answer"))
        async with asyncio.timeout(CONNECT_SECONDS):
            await connected.wait()
        make = random.choice((_endless_picture, _holes, _noise, _sources, _reports))
        (payload_type,) = re.findall(r"a=rtpmap:(\d+) VP8/", answer.text)
        picture = RtpPacket(payload_type=int(payload_type), ssrc=random.getrandbits(32))
        target.seen[f"publisher{make.__name__}"] += await _flood(
            pc.getTransceivers()[0].receiver.transport, make, picture, random
        )
    finally:
        await pc.close()


async def _flood(
    transport: Any, make: Callable[[int, RtpPacket, Random], bytes], packet: RtpPacket, random: Random
) -> int:
    """Send packets made from `packet`, and return their number."""
    sent, end = 0, time.monotonic() + FLOOD_SECONDS
    while time.monotonic() < end and transport.state == "connected":
        for _ in range(BURST):
            sent += 1
            await transport._send_rtp(make(sent, packet, random))
        await asyncio.sleep(0)  # aiortc's own turn
    return sent


def _rtp(packet: RtpPacket, number: int, payload: bytes, timestamp: int = 0) -> bytes:
    packet.sequence_number, packet.timestamp, packet.payload = number & 0xFFFF, timestamp & 0xFFFFFFFF, payload
    return packet.serialize()


def _endless_picture(number: int, packet: RtpPacket, random: Random) -> bytes:
    return _rtp(packet, number, PICTURE)


def _holes(number: int, packet: RtpPacket, random: Random) -> bytes:
    """Leave out each second packet: all are waited for, and asked for."""
    return _rtp(packet, 2 * number, PICTURE, 3000 * number)


def _noise(number: int, packet: RtpPacket, random: Random) -> bytes:
    return _rtp(packet, number, random.randbytes(random.randrange(1200)), random.getrandbits(32))


def _sources(number: int, packet: RtpPacket, random: Random) -> bytes:
    packet.ssrc = random.getrandbits(32)
    return _rtp(packet, number, PICTURE)


def _reports(number: int, packet: RtpPacket, random: Random) -> bytes:
    """Make a report as full as it can be, each from a new source."""
    blocks = [RtcpReceiverInfo(random.getrandbits(32), 0, 0, 0, 0, 0, 0) for _ in range(31)]
    return bytes(RtcpRrPacket(random.getrandbits(32), blocks))
