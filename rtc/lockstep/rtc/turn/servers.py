"""The STUN and TURN servers to ask (RFC 7064, RFC 7065), and a STUN server's answer about the address of this side."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

from lockstep.rtc.addresses import Address
from lockstep.rtc.stun import BINDING, StunError, parse_address
from lockstep.rtc.turn.messages import Attribute
from lockstep.rtc.turn.requests import Requests
from lockstep.rtc.turn.settings import TurnSettings

__all__ = ["IceServer", "MappedAddress", "ServerUri", "ServerUriError", "parse_server_uri", "server_uris"]

URI = re.compile(
    r"(?P<scheme>stuns?|turns?):(?P<host>\[[0-9A-Fa-f:.]{2,45}\]|[A-Za-z0-9._~-]{1,253})(?::(?P<port>\d{1,5}))?"
    r"(?:\?transport=(?P<transport>udp|tcp))?",
    re.IGNORECASE,
)
PORTS = {"stun": 3478, "turn": 3478, "stuns": 5349, "turns": 5349}
MAX_SERVERS = 8  # servers that are asked: each costs a connection attempt and candidates


class ServerUriError(ValueError):
    """Not a URI of a STUN or TURN server."""


@dataclass(frozen=True, slots=True)
class IceServer:
    """One server by one or more ways, and its credentials, like RTCIceServer of W3C."""

    urls: Sequence[str]
    username: str | None = None
    credential: str | None = field(default=None, repr=False)


@dataclass(frozen=True, slots=True)
class ServerUri:
    scheme: Literal["stun", "turn"]
    host: str  # a name or an IP address
    port: int
    transport: Literal["udp", "tcp"]
    tls: bool


def parse_server_uri(text: str) -> ServerUri:
    """Return the parts of a URI.

    Raises:
        ServerUriError: it is not the URI of a STUN or TURN server.
    """
    match = URI.fullmatch(text)
    port = int(match["port"] or PORTS[match["scheme"].lower()]) if match is not None else 0
    if match is None or not 0 < port < 1 << 16:
        raise ServerUriError(f"not the URI of a STUN or TURN server: {text[:200]!r}")
    scheme = match["scheme"].lower()
    tls = scheme.endswith("s")
    transport = (match["transport"] or ("tcp" if tls else "udp")).lower()
    return ServerUri(
        "stun" if scheme.startswith("stun") else "turn",
        match["host"].strip("[]"),
        port,
        "tcp" if transport == "tcp" else "udp",
        tls,
    )


def server_uris(servers: Iterable[IceServer], counts: Counter[str]) -> list[tuple[ServerUri, IceServer]]:
    """Return the servers that can be asked: at most MAX_SERVERS, each once. Others are counted by reason."""
    found: dict[ServerUri, IceServer] = {}
    for server in servers:
        for url in server.urls:
            try:
                uri = parse_server_uri(url)
            except ServerUriError:
                counts["server_malformed"] += 1
                continue
            if (uri.scheme == "stun" and uri.transport == "tcp") or (uri.tls and uri.transport == "udp"):
                counts["server_unsupported"] += 1  # no address for UDP is learnt there; TURN over DTLS is not in use
            elif uri.scheme == "turn" and (server.username is None or server.credential is None):
                counts["server_without_credentials"] += 1
            elif len(found) < MAX_SERVERS:
                found.setdefault(uri, server)
    return list(found.items())


class MappedAddress:
    """Asks one STUN server from one socket for the address that it sees (RFC 8445 5.1.1.2). A core like the others.

    `mapped` is the address when it is known; `done`: nothing more will come.
    """

    def __init__(self, random_bytes: Callable[[int], bytes], settings: TurnSettings | None = None) -> None:
        self._requests = Requests(random_bytes, settings or TurnSettings())
        self.mapped: Address | None = None
        self.done = False

    def start(self, now: float) -> None:
        self._requests.begin(BINDING, (), now)

    def receive(self, data: bytes, now: float) -> None:
        self._requests.receive(data, now)
        self._settle()

    def data_to_send(self) -> list[bytes]:
        return self._requests.data_to_send()

    def timer(self) -> float | None:
        return None if self.done else self._requests.timer()

    def handle_timer(self, now: float) -> None:
        self._requests.handle_timer(now)
        self._settle()

    def _settle(self) -> None:
        for answer in self._requests.answers():
            self.done = True
            try:
                value = answer.attributes.get(Attribute.XOR_MAPPED_ADDRESS)
                self.mapped = parse_address(value, answer.request.transaction)
            except StunError:
                self.mapped = None
