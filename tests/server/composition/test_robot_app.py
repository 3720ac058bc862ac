"""Start and shutdown of the whole console."""

import asyncio
from collections.abc import Iterator
from inspect import iscoroutinefunction
from typing import Any

from lockstep.protocol.console import Seat, SeatRequest
from lockstep.server.composition.robot_app import create_app
from lockstep.server.settings import Settings
from tests.server.rig import PATIENCE, TestPeer, running_bridge, running_console


async def test_a_console_that_ends_with_peers_connected_ends_them_and_rests_the_robot() -> None:
    """That no task is left is checked for every test here."""
    async with running_bridge() as bridge:
        peers = [TestPeer(), TestPeer()]
        try:
            async with running_console(bridge.address[1], scene=True) as rig:
                async with asyncio.timeout(PATIENCE):
                    await rig.dependencies.console.robot.reached.wait()
                for peer, role in zip(peers, ("operator", "observer"), strict=True):
                    await peer.join(rig, rig.token(role), ("control", "session", "stop"))  # type: ignore[arg-type]
                driver = peers[0]
                driver.send("session", SeatRequest())
                now = await driver.feedback()
                await driver.until(lambda each: isinstance(each, Seat) and each.holder != "")  # the seat
                for speed in (0.0, 0.2):
                    await driver.drive([speed] + [0.0] * (len(now.axes) - 1))
            async with asyncio.timeout(PATIENCE):
                for peer in peers:
                    await peer.closed.wait()
            assert rig.count("lockstep_peers_ended_total", why="shutdown") == 2
            assert rig.count("lockstep_rests_total", why="disconnected") == 1
            assert len(rig.dependencies.console.peers) == 0
        finally:
            for peer in peers:
                await peer.close()


async def test_one_process_can_run_several_consoles_one_after_the_other() -> None:
    async with running_bridge() as bridge:
        for _ in range(2):
            async with running_console(bridge.address[1]) as rig:
                async with asyncio.timeout(PATIENCE):
                    await rig.dependencies.console.robot.reached.wait()


def test_an_app_is_made_without_touching_anything() -> None:
    assert create_app(Settings()).title == "Lockstep"


def test_no_request_leaves_the_loop_for_a_thread_before_its_route_asks_for_one() -> None:
    """FastAPI calls what is not a coroutine on a thread, where it would meet the state of the loop half changed."""
    for settings in (Settings(), Settings(robots=("left=tcp://127.0.0.1:1",))):
        called = list(_called(create_app(settings)))
        assert called
        assert [each for each in called if not iscoroutinefunction(each)] == []


def _called(router: Any) -> Iterator[Any]:
    """All routes and what they depend on, of included routers too."""
    for route in router.routes:
        if included := getattr(route, "original_router", None):
            yield from _called(included)
        elif dependant := getattr(route, "dependant", None):
            yield dependant.call
            yield from (each.call for each in dependant.dependencies)
