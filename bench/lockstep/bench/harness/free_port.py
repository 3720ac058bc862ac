"""Finds a port for a server that cannot report which one it has got."""

import random
import socket

__all__ = ["free_port"]

# Below those that systems give to outgoing connections (32768 and up on Linux, 49152 and up elsewhere): one of them may
# be taken again before the server listens.
PORTS = range(10_000, 32_768)
TRIES = 100


def free_port() -> int:
    """Return a port that is free for TCP and UDP, on all addresses, just now.

    Raises:
        OSError: none of the tried ports is free.
    """
    for port in random.SystemRandom().sample(PORTS, TRIES):
        with (
            socket.socket(socket.AF_INET, socket.SOCK_STREAM) as tcp,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
        ):
            try:
                tcp.bind(("", port))
                udp.bind(("", port))
            except OSError:
                continue
            return port
    raise OSError("no free port")
