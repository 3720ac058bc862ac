"""Tells the protocol of a datagram on a WebRTC path by its first bytes (RFC 7983 7, RFC 5761 4)."""

from enum import Enum

__all__ = ["DatagramKind", "datagram_kind"]


class DatagramKind(Enum):
    STUN = "stun"
    DTLS = "dtls"
    RTP = "rtp"
    RTCP = "rtcp"
    UNKNOWN = "unknown"  # ZRTP, TURN channels, or nothing that this package reads: drop and count it


def datagram_kind(data: bytes) -> DatagramKind:
    if not data:
        return DatagramKind.UNKNOWN
    first = data[0]
    if 128 <= first <= 191:
        # RFC 5761 4: of packet types 192 to 223, which RTP payload types leave free, all are RTCP.
        return DatagramKind.RTCP if len(data) > 1 and 192 <= data[1] <= 223 else DatagramKind.RTP
    if 20 <= first <= 63:
        return DatagramKind.DTLS
    if first <= 3:
        return DatagramKind.STUN
    return DatagramKind.UNKNOWN
