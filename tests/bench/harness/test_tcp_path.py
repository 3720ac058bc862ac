import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from lockstep.bench.harness.tcp_path import TcpPath

BROKEN = (ConnectionResetError, asyncio.IncompleteReadError)


@asynccontextmanager
async def echo(greeting: bytes = b"") -> AsyncIterator[tuple[str, int]]:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(greeting)
        while data := await reader.read(1 << 16):
            writer.write(data)
        writer.close()

    async with await asyncio.start_server(answer, "127.0.0.1", 0) as server:
        host, port = server.sockets[0].getsockname()[:2]
        yield host, port


async def test_what_is_sent_arrives_and_its_end_too() -> None:
    async with echo() as target, TcpPath(target) as path:
        reader, writer = await asyncio.open_connection("127.0.0.1", path.port)
        sent = bytes(range(256)) * 1000
        writer.write(sent)
        assert await reader.readexactly(len(sent)) == sent
        writer.close()
        assert await reader.read() == b""


async def test_a_cut_breaks_connections_and_new_ones_lead_to_the_new_target() -> None:
    async with echo(b"one") as one, echo(b"two") as two, TcpPath(one) as path:
        reader, writer = await asyncio.open_connection("127.0.0.1", path.port)
        assert await reader.readexactly(3) == b"one"
        path.cut()
        with pytest.raises(BROKEN):
            await reader.readexactly(1)
        writer.close()
        path.target = two
        reader, writer = await asyncio.open_connection("127.0.0.1", path.port)
        assert await reader.readexactly(3) == b"two"
        writer.close()


async def test_while_it_is_away_connections_break() -> None:
    async with echo(b"one") as target, TcpPath(target) as path:
        path.away = True
        reader, writer = await asyncio.open_connection("127.0.0.1", path.port)
        with pytest.raises(BROKEN):
            await reader.readexactly(1)
        writer.close()


async def test_a_slow_path_takes_its_time_each_way() -> None:
    loop = asyncio.get_running_loop()
    async with echo() as target, TcpPath(target, delay=0.05) as path:
        reader, writer = await asyncio.open_connection("127.0.0.1", path.port)
        began = loop.time()
        writer.write(b"ping")
        assert await reader.readexactly(4) == b"ping"
        assert loop.time() - began >= 0.1
        writer.close()


async def test_it_may_be_entered_again_after_it_was_left_or_its_port_could_not_be_opened(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def refuse(*_: object) -> asyncio.Server:
        raise OSError("planted")

    async with echo(b"one") as target:
        path = TcpPath(target)
        with monkeypatch.context() as broken:
            broken.setattr(asyncio, "start_server", refuse)
            with pytest.raises(OSError, match="planted"):
                await path.__aenter__()
        for _ in range(2):
            async with path:
                reader, writer = await asyncio.open_connection("127.0.0.1", path.port)
                assert await reader.readexactly(3) == b"one"
                writer.close()
