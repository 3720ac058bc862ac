"""Takes a peer's voice off one media section; aiortc's receiver would decode it in a thread, into queues without bound.

What is used of aiortc, pinned by tests: `RTCRtpReceiver.receive`, `.stop`, `._handle_rtp_packet`,
`._handle_rtcp_packet`, `._handle_disconnect`; `RTCDtlsTransport._register_rtp_receiver`, `._unregister_rtp_receiver`;
`RTCRtpTransceiver._codecs`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from aiortc import RTCRtpTransceiver
from aiortc.rtp import RtpPacket

__all__ = ["VoicePacket", "take_voice"]


class VoicePacket(NamedTuple):
    """One Opus packet."""

    sequence_number: int  # 16 bits
    payload: bytes


def take_voice(transceiver: RTCRtpTransceiver, take: Callable[[VoicePacket], None]) -> bool:
    """Answer that this section's voice is taken, and give each packet to `take`; False when it offers no Opus.

    Call after setRemoteDescription(offer), before createAnswer.
    """
    opus = [codec for codec in transceiver._codecs if codec.name.lower() == "opus"]
    if not opus:
        return False
    transceiver._codecs = opus[:1]
    transceiver._headerExtensions = [each for each in transceiver._headerExtensions if each.uri.endswith(":sdes:mid")]
    transceiver.direction = "recvonly"
    receiver: Any = transceiver.receiver
    registered = False

    async def receive(parameters: Any) -> None:
        nonlocal registered
        if not registered:
            registered = True
            receiver.transport._register_rtp_receiver(receiver, parameters)

    async def stop() -> None:
        nonlocal registered
        if registered:
            registered = False
            receiver.transport._unregister_rtp_receiver(receiver)

    async def handle(packet: RtpPacket, arrival_time_ms: int) -> None:
        if packet.payload and packet.payload_type == opus[0].payloadType:
            take(VoicePacket(packet.sequence_number, packet.payload))

    async def ignore(packet: Any) -> None:
        """Sender reports: nothing is synchronised with it."""

    receiver.receive, receiver.stop = receive, stop
    receiver._handle_rtp_packet, receiver._handle_rtcp_packet = handle, ignore
    receiver._handle_disconnect = lambda: None
    return True
