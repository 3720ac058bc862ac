import asyncio
import os
import sys

import pytest

from lockstep.protocol.pipe.parent_process import STARTED_BY, parent_ended, parent_of


async def test_a_parent_that_ended_before_the_first_look_has_ended() -> None:
    async with asyncio.timeout(20):
        await parent_ended(os.getpid())  # which is not this process' parent


async def test_a_parent_that_lives_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = iter([STARTED_BY, STARTED_BY, 1])
    monkeypatch.setattr(os, "getppid", lambda: next(looks))
    async with asyncio.timeout(20):
        await parent_ended(interval=0.0)
    assert list(looks) == []


def test_the_parent_is_the_process_that_started_this_one() -> None:
    assert parent_of([]) == parent_of([str(STARTED_BY)]) == STARTED_BY


async def test_a_parent_that_ended_while_this_process_was_starting_has_ended() -> None:
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", "")
    await process.wait()
    assert parent_of([str(process.pid)]) == process.pid
    async with asyncio.timeout(20):
        await parent_ended(process.pid)


def test_where_another_program_stands_between_the_helper_ends_with_that(monkeypatch: pytest.MonkeyPatch) -> None:
    assert parent_of([str(os.getpid())]) == STARTED_BY

    def of_another_user(process: int, number: int) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "kill", of_another_user)
    assert parent_of([str(os.getpid())]) == STARTED_BY


def test_a_parent_that_is_no_number_is_an_error() -> None:
    with pytest.raises(ValueError, match="invalid literal"):
        parent_of(["parent"])
