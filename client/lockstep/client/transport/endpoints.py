"""Endpoints on the addresses of this machine."""

from collections.abc import Sequence

from lockstep.rtc.endpoint import Endpoint

__all__ = ["open_endpoint"]


def open_endpoint(hosts: Sequence[str]) -> Endpoint:
    """Return an endpoint on all of these addresses that can be bound: a new address may not be ready yet."""
    try:
        return Endpoint(hosts)
    except OSError:
        endpoint = Endpoint([])
        endpoint.use_hosts(hosts)
        return endpoint
