"""Addresses and paths of datagrams."""

from typing import Literal, NamedTuple

__all__ = ["Address", "Datagram", "Path", "Transport"]

Address = tuple[str, int]  # IP address as `ipaddress` writes it, and port
Transport = Literal["udp", "tcp"]  # tcp: datagrams framed as in RFC 4571 on one connection


class Path(NamedTuple):
    """A local and a remote address, and the transport between them. An answer takes the path of its request."""

    local: Address
    remote: Address
    transport: Transport = "udp"


class Datagram(NamedTuple):
    """One datagram to send."""

    data: bytes
    path: Path

    @property
    def local(self) -> Address:
        return self.path.local

    @property
    def remote(self) -> Address:
        return self.path.remote
