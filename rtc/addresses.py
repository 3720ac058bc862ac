"""Where datagrams come from and go to."""

from dataclasses import dataclass

__all__ = ["Address", "Datagram"]

Address = tuple[str, int]  # IP address as `ipaddress` writes it, and port


@dataclass(frozen=True, slots=True)
class Datagram:
    """One datagram to send. It leaves from `local`: an answer comes from the address that was asked."""

    data: bytes
    local: Address
    remote: Address
