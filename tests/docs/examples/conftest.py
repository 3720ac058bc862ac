from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.docs.examples.robots import Robot, in_c, in_python


@pytest.fixture(params=[in_c, in_python], ids=["c", "python"])
async def robot(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Robot]:
    async with request.param(tmp_path) as running:
        yield running
