"""Lets plain aiortc use chosen addresses: aioice never gathers loopback, and has no setting for addresses."""

from collections.abc import Sequence

import aioice.ice

__all__ = ["use_hosts"]


def use_hosts(addresses: Sequence[str]) -> None:
    """Make aioice gather host candidates at exactly these addresses, in the whole process."""
    chosen = list(addresses)

    def get_host_addresses(use_ipv4: bool, use_ipv6: bool) -> list[str]:
        return [address for address in chosen if (use_ipv6 if ":" in address else use_ipv4)]

    aioice.ice.get_host_addresses = get_host_addresses
