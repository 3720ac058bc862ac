"""Bridges that do what they should not, beside one that works."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

import pytest

from tests.server.fleet.rig import drive_once, running_fleet
from tests.server.rig import PATIENCE, running_bridge


async def _garbage(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """What is no message, for ever."""
    with contextlib.suppress(ConnectionError):
        while not writer.is_closing():
            writer.write(b"\x00\x00\x00\x05\xc1\xff\x00ab" * 100)
            await writer.drain()
            await asyncio.sleep(0)


async def _endless(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """A message that says it is huge."""
    with contextlib.suppress(ConnectionError):
        while not writer.is_closing():
            writer.write(b"\x7f\xff\xff\xff" + bytes(60_000))
            await writer.drain()
            await asyncio.sleep(0)


async def _hung(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Takes the connection and never says a word."""
    await reader.read()


async def _gone(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Closes at once."""


@pytest.mark.parametrize("behaviour", [_garbage, _endless, _hung, _gone])
async def test_a_bridge_that_misbehaves_disturbs_no_other_robot(
    behaviour: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]],
) -> None:
    seen = asyncio.Event()

    async def bad_bridge(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        seen.set()
        try:
            await behaviour(reader, writer)
        finally:
            writer.close()

    bad = await asyncio.start_server(bad_bridge, "127.0.0.1", 0)
    try:
        async with (
            running_bridge() as good,
            running_fleet({"bad": bad.sockets[0].getsockname()[1], "good": good.address[1]}) as rig,
        ):
            async with asyncio.timeout(PATIENCE):
                await seen.wait()
                await rig.session("good").console.robot.reached.wait()
            async with rig.peer("good", "operator") as peer:
                await drive_once(peer)
                for _ in range(5):
                    await peer.drive([0.0] * len(peer.newest_feedback().axes))
                assert not peer.closed.is_set()
            tiles = await rig.tiles()
            assert (tiles["bad"]["link"], tiles["good"]["link"]) == ("down", "up")
            assert rig.fleet.sessions["bad"].dependencies is not None
    finally:
        bad.close()
        await bad.wait_closed()
