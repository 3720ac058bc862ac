"""Tells from the kernel whether a TCP connection's path has a queue. Linux only; elsewhere nothing is known."""

import socket
import struct
import sys
from typing import NamedTuple, Protocol

__all__ = ["PathQueue", "path_queue"]

# struct tcp_info of linux/tcp.h: tcpi_rtt; tcpi_notsent_bytes and tcpi_min_rtt behind it
RTT_AT, BEHIND_AT = 68, 144
LENGTH = 152
UNKNOWN = 0xFFFFFFFF


class PathQueue(NamedTuple):
    """What waits on the way to the other side."""

    unsent: int  # bytes that the kernel has not sent yet
    seconds: float  # by which a round trip is longer than the shortest of the last minutes


class InfoSocket(Protocol):
    def getsockopt(self, level: int, name: int, length: int) -> bytes: ...


def path_queue(tcp: InfoSocket) -> PathQueue | None:
    """Return what waits; None where the kernel does not say."""
    if sys.platform != "linux":
        return None
    try:
        info = tcp.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, LENGTH)
    except OSError:  # not a TCP socket, or it is closed
        return None
    if len(info) < LENGTH:  # a kernel before 4.9
        return None
    (round_trip,) = struct.unpack_from("=I", info, RTT_AT)  # µs, smoothed
    unsent, shortest = struct.unpack_from("=II", info, BEHIND_AT)
    if UNKNOWN in (round_trip, shortest):
        return PathQueue(unsent, 0.0)
    return PathQueue(unsent, max(0, round_trip - shortest) / 1e6)
