"""Reads and changes an SDP for a forwarder, so that each side only knows the forwarder. Text in, text out."""

import re
from typing import NamedTuple

from lockstep.emulator.errors import BadDescription

__all__ = ["Address", "candidates_replaced", "console_addresses", "ice_names", "reached_from", "without_candidates"]

UFRAG = re.compile(r"^a=ice-ufrag:(\S+)", re.MULTILINE)
HOST = re.compile(r"^a=candidate:\S+ 1 udp \d+ (\d+\.\d+\.\d+\.\d+) (\d+) typ host", re.MULTILINE | re.IGNORECASE)
TOP_PRIORITY = 2130706431  # RFC 8445 5.1.2.1: host, highest local preference, component 1
LOCAL_STEP = 256  # in the priority: one less local preference


class Address(NamedTuple):
    host: str
    port: int


def ice_names(sdp: str) -> set[str]:
    """Return the username fragments."""
    return set(UFRAG.findall(sdp))


def console_addresses(sdp: str) -> list[Address]:
    """Return the addresses at which the console's answer says that it listens, IPv4 only.

    Raises:
        BadDescription: none of them can be reached by a forwarder.
    """
    found = [Address(host, int(port)) for host, port in HOST.findall(sdp)]
    if not found:
        raise BadDescription("the console's answer has no IPv4 host candidate; start it with --ice-host ADDRESS")
    return found


def reached_from(host: str, console: list[Address]) -> Address:
    """Return the console's address for a client that finds the forwarder at `host`.

    It is the same if the console has it, else the first. The answer to a check tells the client the address from which
    the forwarder's other side sent it (RFC 8445 7.2.5.3.1). Firefox goes no further if that is a loopback address and
    its own is not.
    """
    return next((each for each in console if each.host == host), console[0])


def without_candidates(sdp: str) -> str:
    """Return the offer, or a fragment of trickle ICE, without a way around the forwarder.

    The console learns the client's addresses from the checks that arrive. The end of candidates is removed too, or ICE
    would give up at once.
    """
    kept = [line for line in sdp.splitlines() if not line.startswith(("a=candidate:", "a=end-of-candidates"))]
    return "\r\n".join(kept) + "\r\n"


def candidates_replaced(sdp: str, addresses: list[Address]) -> str:
    """Return the answer with `addresses` in place of each section's own candidates."""
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
