"""The addresses at which the console is reached for media."""

import errno
import socket
from typing import Protocol

from lockstep.rtc.interfaces import own_addresses

__all__ = [
    "MediaAddressUnusable",
    "MediaHostSettings",
    "MediaPortTaken",
    "NoSuchAddress",
    "check_media_addresses",
    "media_hosts",
]

LOOPBACK = "127.0.0.1"


class MediaHostSettings(Protocol):
    """The settings that determine the addresses."""

    @property
    def host(self) -> str: ...
    @property
    def ice_hosts(self) -> tuple[str, ...]: ...
    @property
    def bound_to_loopback(self) -> bool: ...
    @property
    def media_port(self) -> int: ...
    @property
    def media_tcp(self) -> bool: ...


class MediaAddressUnusable(Exception):
    """An address or port of the settings cannot be used for media."""


class NoSuchAddress(MediaAddressUnusable):
    def __init__(self, address: str, reason: str) -> None:
        super().__init__(address, reason)
        self.address = address
        self.reason = reason

    def __str__(self) -> str:
        return (
            f"ice_hosts: media cannot use {self.address} ({self.reason}). Give an address of this machine here, "
            "and the outer address of a one-to-one NAT with --advertise"
        )


class MediaPortTaken(MediaAddressUnusable):
    def __init__(self, address: str, port: int, transport: str, reason: str) -> None:
        super().__init__(address, port, transport, reason)
        self.address = address
        self.port = port
        self.transport = transport
        self.reason = reason

    def __str__(self) -> str:
        return (
            f"media_port: {self.transport} port {self.port} of {self.address} cannot be used ({self.reason}). "
            "Choose another with --media-port, or 0 for any free one"
        )


def check_media_addresses(settings: MediaHostSettings) -> None:
    """Check that media can use the addresses and the port of the settings; else browsers would be offered nothing.

    Raises:
        NoSuchAddress: an address does not belong to this machine.
        MediaPortTaken: the port cannot be bound.
    """
    kinds = [("UDP", socket.SOCK_DGRAM)]
    if settings.media_tcp and settings.media_port:
        kinds.append(("TCP", socket.SOCK_STREAM))
    for address in media_hosts(settings) if settings.media_port else settings.ice_hosts:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        for transport, kind in kinds:
            with socket.socket(family, kind) as probe:
                if kind == socket.SOCK_STREAM:
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
                try:
                    probe.bind((address, settings.media_port))
                except OSError as error:
                    reason = error.strerror or str(error)
                    if error.errno in (errno.EADDRINUSE, errno.EACCES):
                        raise MediaPortTaken(address, settings.media_port, transport, reason) from error
                    if address in settings.ice_hosts:
                        raise NoSuchAddress(address, reason) from error


def media_hosts(settings: MediaHostSettings) -> list[str]:
    """Return the addresses of the settings, or all that this machine has now; preferred ones first.

    A console bound to loopback offers loopback and this machine's other addresses: Firefox pairs loopback with nothing
    unless a hidden preference says so, and reaches the console by another address. Only clients that got ICE
    credentials over the loopback-bound signalling can use either.
    """
    if settings.ice_hosts:
        return list(settings.ice_hosts)
    if settings.bound_to_loopback:
        return [settings.host if settings.host != "localhost" else LOOPBACK, *own_addresses()]
    return own_addresses()
