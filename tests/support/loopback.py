"""Plain aiortc on loopback, for as long as a test needs it."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import aioice.ice

from lockstep.bench.harness.aioice_hosts import use_hosts

__all__ = ["aioice_at"]


@contextmanager
def aioice_at(addresses: Sequence[str]) -> Iterator[None]:
    """While entered, aioice gathers host candidates at exactly these addresses."""
    original = aioice.ice.get_host_addresses
    use_hosts(addresses)
    try:
        yield
    finally:
        aioice.ice.get_host_addresses = original
