"""Coroutines without a task."""

import asyncio

import pytest

from server.run_now import run_now


async def test_what_has_nothing_to_wait_for_is_done_at_once() -> None:
    done: list[str] = []

    async def inner() -> str:
        return "inner"

    async def work() -> None:
        done.append(await inner())

    run_now(work())
    assert done == ["inner"]


async def test_what_it_raises_is_raised() -> None:
    async def fail() -> None:
        raise ConnectionError("gone")

    with pytest.raises(ConnectionError, match="gone"):
        run_now(fail())


async def test_what_would_wait_is_closed_and_named() -> None:
    closed: list[bool] = []

    async def wait() -> None:
        try:
            await asyncio.sleep(1)
        finally:
            closed.append(True)

    with pytest.raises(RuntimeError, match="wait.*waits for something"):
        run_now(wait())
    assert closed == [True]
