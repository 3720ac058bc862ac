"""Packets and a stage for tests."""

from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import ReportBlock

__all__ = ["SSRC", "block", "packet"]

SSRC = 7


def packet(number: int = 1, payload: bytes = b"payload", **changes: object) -> RtpPacket:
    found = RtpPacket(96, number & 0xFFFF, 1000, SSRC, payload)
    for name, value in changes.items():
        setattr(found, name, value)
    return found


def block(highest: int = 10, lost: int = 0, last_report: int = 0, delay: int = 0) -> ReportBlock:
    return ReportBlock(SSRC, 0, lost, highest, 0, last_report, delay)
