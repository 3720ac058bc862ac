"""The stage that turns retransmissions into the packets that they repeat (RFC 4588 4), on the way in."""

from collections.abc import Mapping

from lockstep.rtc.rtp.stage import Stage
from lockstep.rtc.rtp.wire.packet import RtpPacket

__all__ = ["Repairs"]


class Repairs(Stage):
    def __init__(self, following: Stage, ssrc: int, payload_types: Mapping[int, int]) -> None:
        """`ssrc`: that of the repaired stream; `payload_types`: from a retransmission's to the repeated packet's."""
        super().__init__(following)
        self.repaired = 0  # packets
        self.empty = 0  # retransmissions of nothing: some senders fill up with them to measure the path
        self._ssrc = ssrc
        self._payload_types = dict(payload_types)

    def rtp(self, packet: RtpPacket, now: float) -> None:
        original = self._payload_types.get(packet.payload_type)
        if original is not None:
            if len(packet.payload) < 2:
                self.empty += 1
                return
            self.repaired += 1
            packet.payload_type, packet.ssrc = original, self._ssrc
            packet.sequence_number = int.from_bytes(packet.payload[:2], "big")
            packet.payload = packet.payload[2:]
            packet.is_repair = True
        super().rtp(packet, now)
