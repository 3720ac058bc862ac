"""A port of loopback that leads to another address, and can be slow, away and cut: a simple network for TCP."""

import asyncio
from contextlib import AsyncExitStack, suppress
from types import TracebackType
from typing import Self

__all__ = ["TcpPath"]

READ = 1 << 16  # bytes


class TcpPath:
    """Enter it, then connect to `port` of loopback.

    Attributes:
        target: the address that it leads to; may be changed for new connections
        away: True: new connections break at once
    """

    def __init__(self, target: tuple[str, int], *, delay: float = 0.0) -> None:
        """`delay`: s that what was read waits, each way."""
        self.target = target
        self.away = False
        self._delay = delay
        self._ends: set[asyncio.StreamWriter] = set()
        self._joins: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None
        self._stack = AsyncExitStack()

    @property
    def port(self) -> int:
        if self._server is None:
            raise RuntimeError("enter the path first")
        return int(self._server.sockets[0].getsockname()[1])

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self._tasks: asyncio.TaskGroup = await self._stack.enter_async_context(asyncio.TaskGroup())
        self._stack.callback(self._end_connections)
        self._stack.callback(self._server.close)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    def cut(self) -> None:
        """Break all connections at once."""
        for end in self._ends:
            end.transport.abort()

    def _end_connections(self) -> None:
        self.cut()
        for join in self._joins:
            join.cancel()

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._server is None or not self._server.is_serving():
            writer.transport.abort()
            return
        join = self._tasks.create_task(self._join(reader, writer), name="TCP path")
        self._joins.add(join)
        join.add_done_callback(self._joins.discard)
        join.add_done_callback(lambda _: self._end(writer))  # also of one that was cancelled before its first step

    async def _join(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._ends.add(writer)
        try:
            far_reader, far = await asyncio.open_connection(*self.target)
        except OSError:
            self._end(writer)
            return
        self._ends.add(far)
        if self.away:
            self.cut()
        try:
            await asyncio.gather(self._pass_on(reader, far), self._pass_on(far_reader, writer))
        finally:
            self._end(writer)
            self._end(far)

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(READ):
                if self._delay:
                    await asyncio.sleep(self._delay)
                writer.write(data)
                await writer.drain()
        writer.close()

    def _end(self, writer: asyncio.StreamWriter) -> None:
        writer.transport.abort()
        self._ends.discard(writer)
