"""Headless clients of a real console, through a network."""

import asyncio
from collections.abc import AsyncIterator
from urllib.parse import urlsplit

import pytest
import pytest_asyncio

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.emulator import Constant, Impairment, Network, even_profile, profile_names
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.asyncio(loop_scope="module")

EVENTS = 2
TOLERANCE = 4
SLOW = even_profile("slow", Impairment(delay=Constant(0.02)))


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def stack(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Stack]:
    async with running_stack(tmp_path_factory.mktemp("stack")) as running:
        yield running


async def drive(console: Console, events: int = EVENTS) -> None:
    async with asyncio.timeout(40):
        for _ in range(events):
            await drive_on(console, [0.0, 0.0, 0.3])


async def picture(console: Console) -> None:
    """One that was let through the gate."""
    async with asyncio.timeout(20):
        async for _ in console.pictures():
            return


@pytest.mark.parametrize("name", profile_names())
async def test_on_every_network_commands_are_answered_and_nothing_outside_the_tolerance_is_shown(
    stack: Stack, name: str
) -> None:
    async with (
        Network(name, console_url=stack.console) as network,
        Console(network.link(stack.operator), tolerance=TOLERANCE, connect_seconds=40) as console,
    ):
        await console.take_seat()
        await drive(console)
        await picture(console)
        shown = console.stats().streams
    counts = network.statistics()
    assert counts.clients == 1
    passed = [counts.paths[kind]["to_operator"].passed for kind in ("media", "control")]
    assert min(passed) > 5, "the forwarder is the only way"
    assert sum(stream.rendered for stream in shown if stream.kind == "video") > 0
    assert {stream.stream: stream.violations for stream in shown} == {stream.stream: 0 for stream in shown}


async def test_several_clients_at_once_and_one_after_the_other_each_have_their_own_forwarder(stack: Stack) -> None:
    async with Network(SLOW, console_url=stack.console) as network:
        link = network.link(stack.observer)
        async with (
            Console(link, video=False, audio=False) as first,
            Console(link, video=False, audio=False) as second,
        ):
            assert first.peer != second.peer
            assert len(network._sessions) == 2
        async with Console(link, video=False, audio=False):
            assert len(network._sessions) == 1, "those of clients that left are closed"
        assert network.statistics().clients == 3


async def test_after_an_ice_restart_the_connection_still_passes_the_network(stack: Stack) -> None:
    async with (
        Network(SLOW, console_url=stack.console) as network,
        Console(network.link(stack.operator), video=False, audio=False) as console,
    ):
        await console.take_seat()
        await drive(console, 2)
        await console.restart_ice()
        before = network.statistics().paths["control"]["to_robot"].passed
        await drive(console, 5)
        assert network.statistics().paths["control"]["to_robot"].passed >= before + 5
        await console.rest()


async def test_an_outage_silences_a_client_and_its_end_brings_it_back(stack: Stack) -> None:
    async with (
        Network(SLOW, console_url=stack.console) as network,
        Console(network.link(stack.operator), video=False, audio=False, silence_seconds=10) as console,
    ):
        await console.take_seat()
        await drive(console, 5)
        network.outage(0.5)
        await drive(console, 2)
        assert network.statistics().paths["control"]["to_robot"].outage_dropped > 3
        await console.rest()


async def test_what_is_set_before_a_robot_is_what_a_console_is_to_connect_to(stack: Stack) -> None:
    parts = urlsplit(stack.robot)
    async with Network(SLOW, robot=(parts.hostname or "", parts.port or 0)) as network:
        forwarder = urlsplit(network.robot_address)
        assert (forwarder.scheme, forwarder.hostname) == ("tcp", "127.0.0.1")
        assert forwarder.port not in (parts.port, None)


async def test_one_network_has_one_console(stack: Stack) -> None:
    async with Network(SLOW) as network:
        assert await network.open_console(stack.console) == network.console_url
        with pytest.raises(RuntimeError, match="already"):
            await network.open_console(stack.console)
