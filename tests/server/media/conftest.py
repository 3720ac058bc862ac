from collections.abc import Iterator

import pytest

from tests.support.loopback import aioice_at


@pytest.fixture(autouse=True)
def loopback() -> Iterator[None]:
    with aioice_at(["127.0.0.1"]):
        yield
