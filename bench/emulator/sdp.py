"""What a relay reads and writes in an SDP so that both sides only know of it. Text in, text out."""

import re
from typing import NamedTuple

from bench.emulator.errors import BadDescription

__all__ = ["Address", "candidates_replaced", "console_address", "ice_names", "without_candidates"]

UFRAG = re.compile(r"^a=ice-ufrag:(\S+)", re.MULTILINE)
HOST = re.compile(r"^a=candidate:\S+ 1 udp \d+ (\d+\.\d+\.\d+\.\d+) (\d+) typ host", re.MULTILINE | re.IGNORECASE)
TOP_PRIORITY = 2130706431  # RFC 8445 5.1.2.1: host, highest local preference, component 1
LOCAL_STEP = 256  # in the priority: one less local preference


class Address(NamedTuple):
    host: str
    port: int


def ice_names(sdp: str) -> set[str]:
    """The username fragments."""
    return set(UFRAG.findall(sdp))


def console_address(sdp: str) -> Address:
    """Where the console's answer says that it listens: loopback if it does, else its first IPv4 address.

    Raises:
        BadDescription: it names no address that a relay here can reach.
    """
    found = [Address(host, int(port)) for host, port in HOST.findall(sdp)]
    if not found:
        raise BadDescription("the console's answer has no IPv4 host candidate; start it with --ice-host ADDRESS")
    return next((each for each in found if each.host.startswith("127.")), found[0])


def without_candidates(sdp: str) -> str:
    """The offer, or a fragment of trickle ICE, with which nobody finds a way around the relay.

    The console learns where to send from the checks that arrive. "That was all" goes too, or ICE would give up at once.
    """
    kept = [line for line in sdp.splitlines() if not line.startswith(("a=candidate:", "a=end-of-candidates"))]
    return "\r\n".join(kept) + "\r\n"


def candidates_replaced(sdp: str, addresses: list[Address]) -> str:
    """The answer, with `addresses` in place of each section's own candidates."""
    lines: list[str] = []
    replaced = False  # in this section
    for line in sdp.splitlines():
        if line.startswith("m="):
            replaced = False
        if not line.startswith("a=candidate:"):
            lines.append(line)
        elif not replaced:
            replaced = True
            lines += [
                f"a=candidate:relay{number} 1 udp {TOP_PRIORITY - number * LOCAL_STEP} {host} {port} typ host"
                for number, (host, port) in enumerate(addresses)
            ]
    return "\r\n".join(lines) + "\r\n"
