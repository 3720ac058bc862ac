"""Several TCP connections race to a console whose path may be cut."""

import asyncio
import socket

import pytest

from lockstep.robot_bridge.dial.tcp_race import MOST, connect_first

SOON = 0.001  # s


class Path:
    """Lets connections through from the moment on at which the test says that it is back; those begun before hang."""

    def __init__(self) -> None:
        self.begun = 0
        self.pending = 0
        self.most = 0
        self.first_lives = False
        self.is_back = False
        self.grown = asyncio.Condition()
        self.made: list[socket.socket] = []

    async def connect(self) -> socket.socket:
        self.begun += 1
        mine = self.begun
        if self.is_back:
            self.made.append(socket.socket())
            return self.made[-1]
        self.pending += 1
        self.most = max(self.most, self.pending)
        async with self.grown:
            self.grown.notify_all()
        try:
            await asyncio.Event().wait()
        finally:
            self.pending -= 1
            if mine == 1:
                self.first_lives = False
        raise AssertionError

    async def wait_for(self, begun: int) -> None:
        async with self.grown:
            await self.grown.wait_for(lambda: self.begun >= begun)


async def test_a_new_connection_finds_a_path_that_is_back_while_the_first_still_waits() -> None:
    path = Path()
    race = asyncio.create_task(connect_first("console", 1, interval=SOON, connect=path.connect))
    await path.wait_for(2)
    path.is_back = True
    async with asyncio.timeout(10):
        opened = await race
    assert [opened.socket] == path.made
    assert path.pending == 0
    opened.socket.close()


async def test_few_connections_wait_at_once_and_the_first_is_never_given_up() -> None:
    path = Path()
    path.first_lives = True
    race = asyncio.create_task(connect_first("console", 1, interval=SOON, connect=path.connect))
    await path.wait_for(5 * MOST)
    assert path.most == MOST
    assert path.first_lives
    race.cancel()
    with pytest.raises(asyncio.CancelledError):
        await race
    assert path.pending == 0


async def test_a_refused_connection_ends_the_race_at_once() -> None:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))  # nobody listens there
        with pytest.raises(ConnectionRefusedError):
            await connect_first("127.0.0.1", bound.getsockname()[1])


async def test_a_connection_over_tcp_is_the_one_that_was_asked_for() -> None:
    server = await asyncio.start_server(lambda reader, writer: writer.close(), "127.0.0.1", 0)
    async with server:
        host, port = server.sockets[0].getsockname()
        opened = await connect_first(host, port)
        assert opened.socket.getpeername() == (host, port)
        opened.socket.close()
