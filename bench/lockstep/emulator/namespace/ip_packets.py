"""Finds the path of a profile that an IP packet belongs to. No I/O.

A UDP packet shows the path by its first byte (RFC 7983). A TCP connection shows it by the first bytes of the side that
opened it: a robot link begins with a hello in a frame; everything else is taken for signalling.
"""

import socket
import struct
from collections import OrderedDict
from contextlib import suppress
from typing import Literal

from lockstep.emulator.impairment.packets import kind_of
from lockstep.protocol.errors import MessageError
from lockstep.protocol.messages import Hello, decode_message

__all__ = ["IpKind", "IpSorter"]

IpKind = Literal["stun", "control", "media", "signalling", "robot_control", "robot_media"]
UDP_HEADER = 8
KEPT = 4096  # connections
FRAME_HEADER = 4
Connection = tuple[bytes, bytes]  # both ends, the smaller first


class IpSorter:
    """Sorts packets. Call `kind` for every packet, in order."""

    def __init__(self) -> None:
        self._connections: OrderedDict[Connection, IpKind | None] = OrderedDict()  # None: no byte of data yet

    def kind(self, packet: bytes) -> IpKind | None:
        """Return the kind of a packet; None if it is not an IPv4 packet."""
        if len(packet) < 20 or packet[0] >> 4 != 4:
            return None
        header = (packet[0] & 15) * 4
        protocol = packet[9]
        if protocol == socket.IPPROTO_UDP:
            return kind_of(packet[header + UDP_HEADER : header + UDP_HEADER + 1])
        if protocol == socket.IPPROTO_TCP and len(packet) >= header + 20:
            return self._tcp(packet, header)
        return "control"

    def _tcp(self, packet: bytes, header: int) -> IpKind:
        ends = packet[12:16] + packet[header : header + 2], packet[16:20] + packet[header + 2 : header + 4]
        connection = (min(ends), max(ends))
        known = self._connections.get(connection)
        if known is not None:
            return known
        data = packet[header + (packet[header + 12] >> 4) * 4 : struct.unpack_from("!H", packet, 2)[0]]
        found = _begins(data) if data else None
        self._connections[connection] = found
        if len(self._connections) > KEPT:
            self._connections.popitem(last=False)
        return found or "signalling"


def _begins(data: bytes) -> IpKind:
    length = int.from_bytes(data[:FRAME_HEADER], "big")
    with suppress(MessageError):
        hello = decode_message(data[FRAME_HEADER : FRAME_HEADER + length])
        if isinstance(hello, Hello):
            return "robot_media" if hello.role == "media" else "robot_control"
    return "signalling"
