"""STUN and TURN servers for browsers, and time-limited TURN credentials (draft-uberti-behave-turn-rest-00). No I/O.

A credential is made from a secret that the console and the TURN server share, so nothing has to be told to the server:
the username is the expiry time and a name, the password its HMAC-SHA1 under the secret.
"""

import base64
import hashlib
import hmac
import re
from typing import NamedTuple

import msgspec

__all__ = [
    "IceServer",
    "IceServers",
    "TurnUri",
    "ice_servers",
    "link_headers",
    "read_turn_uri",
    "turn_credential",
]

# RFC 7065 3.1, without the rest of RFC 3986's hosts
TURN_URI = re.compile(r"(turns?):(\[[0-9A-Fa-f:.]+\]|[^\s:?/\[\]]+)(?::(\d{1,5}))?(?:\?transport=(udp|tcp))?")


class TurnUri(NamedTuple):
    scheme: str
    host: str
    port: int
    transport: str


class IceServer(msgspec.Struct, frozen=True, omit_defaults=True):
    """One entry of RTCConfiguration.iceServers."""

    urls: list[str]
    username: str = ""
    credential: str = ""


class IceServers(msgspec.Struct, frozen=True):
    """Answer of GET /api/ice."""

    ice_servers: list[IceServer]
    expires: int | None  # s since 1970; None when nothing expires


def read_turn_uri(uri: str) -> TurnUri:
    """Parse turn:host[:port][?transport=udp|tcp], or turns:. Raises ValueError for anything else."""
    match = TURN_URI.fullmatch(uri)
    if match is None:
        raise ValueError(f"{uri!r} is not turn:host[:port][?transport=udp|tcp]")
    scheme, host, port, transport = match.groups()
    default = "tcp" if scheme == "turns" else "udp"
    return TurnUri(scheme, host.strip("[]"), int(port or (5349 if scheme == "turns" else 3478)), transport or default)


def turn_credential(secret: str, user: str, expires: int) -> tuple[str, str]:
    """Return the username and password that the TURN server accepts until `expires`."""
    username = f"{expires}:{user}"
    digest = hmac.new(secret.encode(), username.encode(), hashlib.sha1).digest()
    return username, base64.b64encode(digest).decode()


def ice_servers(
    stun: tuple[str, ...], turn: tuple[str, ...], secret: str, seconds: float, user: str, now: float
) -> IceServers:
    """Return the servers that `user` may use from `now` (s since 1970) on."""
    servers = [IceServer(list(stun))] if stun else []
    if not turn:
        return IceServers(servers, None)
    expires = int(now + seconds)
    username, credential = turn_credential(secret, user, expires)
    return IceServers([*servers, IceServer(list(turn), username, credential)], expires)


def link_headers(servers: IceServers) -> list[str]:
    """Return the servers as Link headers (RFC 9725 4.6)."""
    lines = []
    for server in servers.ice_servers:
        for url in server.urls:
            line = f'<{url}>; rel="ice-server"'
            if server.username:
                line += f'; username="{server.username}"; credential="{server.credential}"; credential-type="password"'
            lines.append(line)
    return lines
