"""Whether media can use the addresses that were set."""

import socket
from collections.abc import Iterable

__all__ = ["NoSuchAddress", "check_media_addresses"]


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
