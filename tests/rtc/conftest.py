"""Tests of what has sockets run on both event loops: consoles run on uvloop, whose transports are its own classes."""

import asyncio
from collections.abc import Callable, Mapping

import pytest
import uvloop

SHELLS = ("test_endpoint.py", "test_turn_client.py", "test_tcp_port.py", "test_udp_socket.py")


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    usual: dict[str, Callable[[], asyncio.AbstractEventLoop]] = {"asyncio": asyncio.new_event_loop}
    return usual | ({"uvloop": uvloop.new_event_loop} if item.path.name in SHELLS else {})
