"""The packets of one association: those to read (RFC 9260 8.4 and 8.5), and those that wait to leave."""

from collections import Counter

from lockstep.rtc.sctp.wire.chunks import Abort, Chunk, Error, Init, ShutdownAck, ShutdownComplete, Unknown
from lockstep.rtc.sctp.wire.packet import Packet, encode_packet
from lockstep.rtc.sctp.wire.parameters import UNRECOGNIZED_CHUNK

__all__ = ["Packets"]

MOST_CONTROL = 64  # chunks that wait to leave; the peer gets no answers beyond them
MOST_REPORTED = 128  # bytes of an unknown chunk in the report to its sender


class Packets:
    """Knows the ports, and the verification tags of both ends; `peer_tag` is 0 until the peer is known.

    `control` has encoded chunks that leave with the next packet.
    """

    def __init__(self, port: int, peer_port: int, tag: int, counts: Counter[str]) -> None:
        self.tag = tag
        self.peer_tag = 0
        self.control: list[bytes] = []
        self._port = port
        self._peer_port = peer_port
        self._counts = counts
        self._out: list[bytes] = []

    def refusal(self, packet: Packet, *, ended: bool) -> str:
        """Return the reason not to read a packet (RFC 9260 8.5); "" for a packet to read. `ended`: the association."""
        if packet.source != self._peer_port or packet.destination != self._port:
            return "wrong_port"
        first = packet.chunks[0]
        if ended:
            if isinstance(first, ShutdownAck):  # 8.4 5: the one of this side was lost
                self.send_alone(packet.tag, ShutdownComplete(reflected=True))
            return "ended"
        if type(first) is Init:
            return "" if packet.tag == 0 and len(packet.chunks) == 1 else "wrong_tag"
        if isinstance(first, Abort | ShutdownComplete) and first.reflected:
            return "" if self.peer_tag and packet.tag == self.peer_tag else "wrong_tag"
        return "" if packet.tag == self.tag else "wrong_tag"

    def report_unknown(self, chunk: Chunk) -> bool:
        """Report an unknown chunk. Return True to go on with the packet (RFC 9260 3.2)."""
        assert isinstance(chunk, Unknown)
        self._counts["unknown_chunk"] += 1
        if chunk.kind & 0x40 and self.peer_tag:
            self.answer(Error([(UNRECOGNIZED_CHUNK, chunk.encode()[:MOST_REPORTED])]))
        return bool(chunk.kind & 0x80)

    def answer(self, chunk: Chunk) -> None:
        """Queue an answer, which leaves with the next packet; drop it when too many wait."""
        if len(self.control) < MOST_CONTROL:
            self.control.append(chunk.encode())

    def take_control(self, room: int) -> bytes:
        """Take the control chunks that fit; a larger one waits for the next packet."""
        taken = b""
        while self.control and len(taken) + len(self.control[0]) <= room:
            taken += self.control.pop(0)
        return taken

    def send(self, chunks: bytes) -> None:
        """Send a packet to the peer."""
        self._out.append(encode_packet(self._port, self._peer_port, self.peer_tag, chunks))

    def send_alone(self, tag: int, chunk: Chunk) -> None:
        """Send a packet of one chunk with the verification tag `tag`."""
        self._out.append(encode_packet(self._port, self._peer_port, tag, chunk.encode()))

    def take(self) -> list[bytes]:
        """Take the packets that are ready to leave."""
        out, self._out = self._out, []
        return out
