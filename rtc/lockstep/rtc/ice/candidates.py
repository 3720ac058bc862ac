"""ICE candidates: their priorities (RFC 8445 5.1.2, RFC 6544 4.2), and their lines in SDP (RFC 8839 5.1)."""

import ipaddress
import re
import zlib
from dataclasses import dataclass
from typing import Literal, cast

from lockstep.rtc.addresses import Address, Transport

__all__ = [
    "Candidate",
    "CandidateError",
    "CandidateType",
    "TcpType",
    "candidate_priority",
    "foundation",
    "pair_priority",
    "parse_candidate",
]

CandidateType = Literal["host", "srflx", "prflx", "relay"]
TcpType = Literal["active", "passive", "so"]

TYPE_PREFERENCES: dict[CandidateType, int] = {"host": 126, "prflx": 110, "srflx": 100, "relay": 0}  # RFC 8445 5.1.2.2
TCP_TYPE_STEP = 36  # TCP comes after UDP of the same type, before relayed candidates (RFC 6544 4.2)
TCP_DIRECTIONS: dict[TcpType, int] = {"active": 6, "passive": 4, "so": 2}  # of host candidates (RFC 6544 4.2)
MAX_LINE = 1024  # characters; the longest name of a host has 255
MAX_EXTENSIONS = 16  # pairs of words after the candidate's type

LINE = re.compile(
    r"(?:a=)?(?:candidate:)?(?P<foundation>[A-Za-z0-9+/]{1,32}) (?P<component>\d{1,3}) (?P<transport>[!-~]{1,16})"
    r" (?P<priority>\d{1,10}) (?P<host>[!-~]{1,255}) (?P<port>\d{1,5})"
    r" typ (?P<type>[!-~]{1,16})(?P<more>(?: [^\r\n]*)?)",
    re.IGNORECASE | re.ASCII,
)


class CandidateError(ValueError):
    """A line that is not a candidate, or a candidate with impossible values."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One address at which an agent may be reached."""

    foundation: str  # "1": equal for candidates of one type, base, server and transport (RFC 8445 5.1.1.3)
    component: int  # 1: RTP and all that is multiplexed with it
    transport: Transport
    priority: int  # 1 to 2³¹ − 1
    host: str  # IP address, or a name such as one of mDNS
    port: int
    type: CandidateType
    related: Address | None = None  # raddr and rport, for people who look for faults
    tcp_type: TcpType | None = None
    ufrag: str | None = None  # the ufrag of its session, if the line names it

    @property
    def address(self) -> Address:
        return self.host, self.port

    @property
    def is_ip_address(self) -> bool:
        """False for names (mDNS names need a resolver), and for a zone, which means nothing to another host."""
        return "%" not in self.host and _ip_address(self.host) is not None

    @property
    def can_be_sent_to(self) -> bool:
        """False also for port 0, and for addresses of no single host."""
        address = _ip_address(self.host)
        if address is None or self.port == 0 or address.is_unspecified or address.is_multicast:
            return False
        return self.host != "255.255.255.255"

    def line(self) -> str:
        """Return the candidate as in `RTCIceCandidate.candidate`, and in SDP after `a=`."""
        words = [f"candidate:{self.foundation} {self.component} {self.transport} {self.priority}"]
        words.append(f"{self.host} {self.port} typ {self.type}")
        if self.related is not None:
            words.append(f"raddr {self.related[0]} rport {self.related[1]}")
        if self.tcp_type is not None:
            words.append(f"tcptype {self.tcp_type}")
        if self.ufrag is not None:
            words.append(f"ufrag {self.ufrag}")
        return " ".join(words)


def parse_candidate(line: str) -> Candidate:
    """Return the candidate in `candidate:…`, with or without `a=` before it.

    Raises:
        CandidateError: not a candidate, or one of an unknown type or transport, which RFC 8839 5.1 says to ignore.
    """
    if len(line) > MAX_LINE or (match := LINE.fullmatch(line.strip(" "))) is None:
        raise CandidateError("not a candidate line")
    transport, kind = match["transport"].lower(), match["type"].lower()
    if transport not in ("udp", "tcp") or kind not in TYPE_PREFERENCES:
        raise CandidateError("a candidate of an unknown transport or type")
    extensions = _extensions(match["more"])
    tcp_type = extensions.get("tcptype")
    if transport == "tcp" and tcp_type not in TCP_DIRECTIONS:
        raise CandidateError("a TCP candidate without its type")  # RFC 6544 4.5
    component, priority, port = int(match["component"]), int(match["priority"]), int(match["port"])
    if not (1 <= component <= 256 and 1 <= priority < 1 << 31 and port < 1 << 16):
        raise CandidateError("a component, priority or port out of range")
    return Candidate(
        foundation=match["foundation"],
        component=component,
        transport=cast(Transport, transport),
        priority=priority,
        host=_normal_host(match["host"]),
        port=port,
        type=cast(CandidateType, kind),
        related=_related(extensions),
        tcp_type=cast(TcpType, tcp_type) if transport == "tcp" else None,
        ufrag=extensions.get("ufrag"),
    )


def candidate_priority(kind: CandidateType, local_preference: int, tcp_type: TcpType | None = None) -> int:
    """Return the priority of a candidate of component 1. `local_preference` is 0 to 65535, for TCP 0 to 8191; a higher
    one is tried first.

    RFC 8445 5.1.2.1; RFC 6544 4.2 for TCP.
    """
    preference = TYPE_PREFERENCES[kind]
    if tcp_type is not None:
        preference = max(0, preference - TCP_TYPE_STEP)
        local_preference |= TCP_DIRECTIONS[tcp_type] << 13
    return preference << 24 | local_preference << 8 | 256 - 1


def pair_priority(controlling: int, controlled: int) -> int:
    """Return the priority of a pair, from the priorities of the two agents' candidates (RFC 8445 6.1.2.3)."""
    return (min(controlling, controlled) << 32) + 2 * max(controlling, controlled) + (controlling > controlled)


def foundation(kind: CandidateType, base: str, transport: Transport) -> str:
    """Return a number as text, equal for equal arguments (RFC 8445 5.1.1.3). It need not be unique: candidates with one
    number are tried one after the other."""
    return str(zlib.crc32(f"{kind} {base} {transport}".encode()))


def _normal_host(host: str) -> str:
    """Return the normal form of an IP address, or the name: addresses are compared as text."""
    address = _ip_address(host)
    return host if address is None else str(address)


def _ip_address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


def _extensions(text: str) -> dict[str, str]:
    words = text.split()
    if len(words) > 2 * MAX_EXTENSIONS or len(words) % 2:
        raise CandidateError("extensions that are not pairs, or too many")
    return dict(zip(words[0::2], words[1::2], strict=True))


def _related(extensions: dict[str, str]) -> Address | None:
    host, port = extensions.get("raddr"), extensions.get("rport", "")
    if host is None or not (port.isascii() and port.isdigit() and len(port) <= 5 and int(port) < 1 << 16):
        return None
    return _normal_host(host), int(port)
