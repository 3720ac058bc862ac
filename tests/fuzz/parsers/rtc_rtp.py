"""What RTP and RTCP of a peer must withstand: only RtpError comes out, and what is read goes through every stage."""

from lockstep.rtc.demux import DatagramKind, datagram_kind
from lockstep.rtc.rtp.errors import RtpError
from lockstep.rtc.rtp.incoming import IncomingParameters, IncomingStream
from lockstep.rtc.rtp.outgoing import OutgoingParameters, OutgoingStream, PathShare
from lockstep.rtc.rtp.stage import RoundTrip
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import RtcpPacket, pack_rtcp, parse_rtcp

__all__ = ["try_input"]

LENGTH = 2  # bytes, of a packet's length in an input


def try_input(data: bytes) -> None:
    """A number of packets, each behind its length; a packet a hundredth of a second. Raises whatever goes wrong."""
    share = PathShare(epoch=0.0)
    sender = OutgoingStream(OutgoingParameters(7, 96, 90_000, "x", 0, 0, {"urn:x": 1}), share, paced=True)
    receiver = IncomingStream(IncomingParameters(1, {96: 90_000}, {"urn:x": 1}, {97: 96}), RoundTrip())
    sender.send([b"x"] * 20, 0, 0.0, values={"urn:x": b"x"})
    now = 0.0
    while data:
        end = LENGTH + int.from_bytes(data[:LENGTH], "big")
        packet, data = data[LENGTH:end], data[end:]
        now += 0.01
        try:
            if datagram_kind(packet) is DatagramKind.RTCP:
                for each in parse_rtcp(packet):
                    round_trip(each)
                    sender.rtcp(each, now)
                    receiver.rtcp(each, now)
            else:
                receiver.rtp(RtpPacket.parse(packet), now)
        except RtpError:
            continue
        sender.handle_timer(now)
        receiver.handle_timer(now)
    pack_rtcp([*sender.controls_to_send(), *receiver.controls_to_send()])
    sender.packets_to_send()


def round_trip(packet: RtcpPacket) -> None:
    if not isinstance(packet, RtcpPacket):
        raise AssertionError("not a packet")
    parse_rtcp(packet.pack())
