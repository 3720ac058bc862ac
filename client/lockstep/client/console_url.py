"""Parses the link that `lockstep up` prints: the console's address, and the token that opens it."""

import ipaddress
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from lockstep.client.errors import LinkFormatError

__all__ = ["ConsoleLink", "parse_link"]


class ConsoleLink(NamedTuple):
    base: str  # "http://127.0.0.1:8000"; for one robot of a fleet "http://127.0.0.1:8000/robots/left"
    token: str
    loopback: bool  # True if the console is on this machine

    @property
    def secure(self) -> bool:
        return self.base.startswith("https:")


def parse_link(link: str) -> ConsoleLink:
    """Return the parts of `http://host:port/#token=…`, or of `http://host:port/robots/NAME/#token=…` in a fleet.

    Raises:
        LinkFormatError: the link has neither form.
    """
    try:
        parts = urlsplit(link)
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise LinkFormatError(f"not a link: {error}") from error
    if parts.scheme not in ("http", "https") or not host:
        raise LinkFormatError("a link begins with http:// or https:// and a host")
    token = parse_qs(parts.fragment).get("token", [""])[0]
    if not token:
        raise LinkFormatError("the link has no #token=…; use the whole link that the console printed")
    return ConsoleLink(f"{parts.scheme}://{parts.netloc}{parts.path.rstrip('/')}", token, _is_loopback(host))


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
