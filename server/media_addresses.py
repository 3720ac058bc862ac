"""The addresses at which the console is reached for media."""

import socket
from collections.abc import Iterable
from typing import Protocol

from rtc.interfaces import own_addresses

__all__ = ["MediaHostSettings", "NoSuchAddress", "check_media_addresses", "media_hosts"]

LOOPBACK = "127.0.0.1"


class MediaHostSettings(Protocol):
    """The settings that say which they are."""

    @property
    def host(self) -> str: ...
    @property
    def ice_hosts(self) -> tuple[str, ...]: ...
    @property
    def bound_to_loopback(self) -> bool: ...


class NoSuchAddress(Exception):
    def __init__(self, address: str, reason: str) -> None:
        super().__init__(address, reason)
        self.address = address
        self.reason = reason

    def __str__(self) -> str:
        return (
            f"ice_hosts: media cannot use {self.address} ({self.reason}). It has to be an address of this machine; "
            "the outer one of a one-to-one NAT belongs to --advertise"
        )


def check_media_addresses(addresses: Iterable[str]) -> None:
    """Raises NoSuchAddress for the first that UDP cannot be bound to; with it, browsers would be offered nothing."""
    for address in addresses:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as probe:
                probe.bind((address, 0))
        except OSError as error:
            raise NoSuchAddress(address, error.strerror or str(error)) from error


def media_hosts(settings: MediaHostSettings) -> list[str]:
    """Those that were set, or all that this machine has now; those to prefer first.

    A console bound to loopback offers loopback, and this machine's own addresses: Firefox pairs loopback with nothing
    unless a hidden preference says so, and reaches the console by an own address. Only who got ICE credentials over the
    loopback-bound signalling can use either.
    """
    if settings.ice_hosts:
        return list(settings.ice_hosts)
    if settings.bound_to_loopback:
        return [settings.host if settings.host != "localhost" else LOOPBACK, *own_addresses()]
    return own_addresses()
