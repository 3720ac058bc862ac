import asyncio
import os

import pytest

from lockstep.protocol.pipe.parent_process import STARTED_BY, parent_ended


async def test_a_parent_that_ended_before_the_first_look_has_ended() -> None:
    async with asyncio.timeout(20):
        await parent_ended(os.getpid())  # which is not this process' parent


async def test_a_parent_that_lives_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = iter([STARTED_BY, STARTED_BY, 1])
    monkeypatch.setattr(os, "getppid", lambda: next(looks))
    async with asyncio.timeout(20):
        await parent_ended(interval=0.0)
    assert list(looks) == []
