"""As whom a new connection is counted, before it has said anything."""

import asyncio
import socket
from collections.abc import Callable

import pytest

from lockstep.server.http.transport.acceptor import Acceptor, PlacedProtocol
from lockstep.server.http.transport.connection_places import ConnectionPlaces, Place
from lockstep.server.util.fair_queue import FairQueue


class _Places(ConnectionPlaces):
    """Keeps who came."""

    def __init__(self) -> None:
        super().__init__(10, 10, lambda name: None)
        self.came: asyncio.Queue[tuple[str, bool]] = asyncio.Queue()
        self.are_taken = False  # by who has just come
        self.looked = asyncio.Event()
        self.closes_at_once = False

    def wait(self, now: float) -> float:
        self.looked.set()
        return 0.01 if self.are_taken else 0.0

    def enter(self, address: str, close: Callable[[], None], now: float, *, proxy: bool = False) -> Place:
        self.came.put_nowait((address, proxy))
        if self.closes_at_once:
            asyncio.get_running_loop().call_soon(close)
        return super().enter(address, close, now, proxy=proxy)


def _has_ipv6() -> bool:
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6):
            return True
    except OSError:
        return False


@pytest.mark.parametrize(
    ("host", "comes_from", "counted"),
    [
        ("127.0.0.1", "127.0.0.1", ("127.0.0.1", True)),
        ("127.0.0.1", "127.0.0.2", ("127.0.0.2", False)),
        ("::1", "::1", ("::/64", True)),
    ],
)
async def test_an_ipv6_client_is_counted_by_its_network_and_a_proxy_only_on_this_machine(
    host: str, comes_from: str, counted: tuple[str, bool]
) -> None:
    if ":" in host and not _has_ipv6():
        pytest.skip("this machine has no IPv6")
    places = _Places()
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.create_server((host, 0), family=family) as listener:
        listener.setblocking(False)
        accepting = asyncio.create_task(Acceptor(listener, places, FairQueue(), PlacedProtocol, None).run())
        address = listener.getsockname()[:2]
        _, writer = await asyncio.open_connection(*address, local_addr=(comes_from, 0))
        async with asyncio.timeout(20):
            assert await places.came.get() == counted
        writer.transport.abort()
        accepting.cancel()
        await asyncio.wait([accepting])


async def test_a_newcomer_waits_outside_while_who_has_just_come_had_no_time_to_speak() -> None:
    places = _Places()
    places.are_taken = True
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        accepting = asyncio.create_task(Acceptor(listener, places, FairQueue(), PlacedProtocol, None).run())
        _, writer = await asyncio.open_connection(*listener.getsockname()[:2])
        async with asyncio.timeout(20):
            for _ in range(3):
                places.looked.clear()
                await places.looked.wait()
            assert places.came.empty()
            places.are_taken = False
            await places.came.get()
        writer.transport.abort()
        accepting.cancel()
        await asyncio.wait([accepting])


async def test_a_connection_that_is_given_up_before_it_begins_is_closed_and_has_no_place() -> None:
    places = _Places()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        acceptor = Acceptor(listener, places, FairQueue(), PlacedProtocol, None)
        accepting = asyncio.create_task(acceptor.run())
        places.closes_at_once = True
        reader, writer = await asyncio.open_connection(*listener.getsockname()[:2])
        async with asyncio.timeout(20):
            assert await reader.read() == b""
        assert len(places) == 0
        writer.transport.abort()
        accepting.cancel()
        await asyncio.wait([accepting])
