"""Where a bridge is, and what it takes to be let in."""

import ssl
from typing import NamedTuple
from urllib.parse import urlsplit

from lockstep.protocol.link_secret import LinkSecret

__all__ = ["BadAddress", "Place", "parse_address"]


class BadAddress(Exception):
    """The address is not tcp://host:port or tls://host:port."""


class Place(NamedTuple):
    host: str
    port: int
    secret: LinkSecret | None = None
    tls: ssl.SSLContext | None = None  # None: plain TCP


def parse_address(address: str) -> tuple[str, int, bool]:
    """Host, port, and whether it speaks TLS.

    Raises:
        BadAddress: it is none.
    """
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if host is None or not port or parts.scheme not in ("tcp", "tls") or parts.path.strip("/"):
        raise BadAddress(f"{address!r} is not tcp://host:port or tls://host:port")
    return host, port, parts.scheme == "tls"
