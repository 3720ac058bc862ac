from collections.abc import Iterator

import aioice.ice
import pytest

from server.media.aiortc_private import restrict_ice_hosts


@pytest.fixture(autouse=True)
def loopback() -> Iterator[None]:
    original = aioice.ice.get_host_addresses
    restrict_ice_hosts(["127.0.0.1"])
    yield
    aioice.ice.get_host_addresses = original
