"""The address of a bridge, and the secret and TLS files for a link to it."""

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
    """Return host, port, and whether the address is for TLS.

    Raises:
        BadAddress: the address has another form.
    """
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if host is None or not port or parts.scheme not in ("tcp", "tls") or parts.path.strip("/"):
        raise BadAddress(f"{address!r} is not tcp://host:port or tls://host:port")
    return host, port, parts.scheme == "tls"
