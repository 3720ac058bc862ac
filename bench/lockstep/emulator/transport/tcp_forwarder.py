"""Forwards the robot link between the console and a robot bridge over a stream path for each direction.

The first frame of a connection, the hello, tells its path (docs/robot-link.md). A message is one frame: a picture is
late as a whole.
"""

import asyncio
import socket
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import AsyncExitStack, suppress
from types import TracebackType
from typing import Self

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.path import PathStatistics
from lockstep.emulator.impairment.profile import DIRECTIONS, Direction, Profile
from lockstep.emulator.transport.stream_path import StreamPath
from lockstep.protocol.errors import MessageError
from lockstep.protocol.framing import MAX_MEDIA_FRAME
from lockstep.protocol.messages import Hello, decode_message

__all__ = ["TcpForwarder"]

HEADER = 4  # bytes of a frame's length
READ = 1 << 18  # bytes
WINDOW = 4 << 20  # bytes under way in one direction; beyond it the sender has to wait, as for TCP's window
LITTLE = 4 << 10  # bytes that this machine keeps in front of a bottleneck: the sender is to meet the bottleneck's queue
CONNECT_TIMEOUT = 10.0  # s
Name = str  # "robot_media" or "robot_control"


class TcpForwarder:
    """A forwarder. Connect to `address` instead of to the bridge at `target`. Enter it before use."""

    def __init__(
        self, target: tuple[str, int], profile: Profile, seed: int, outages: Outages, deliveries: Deliveries
    ) -> None:
        self.statistics: dict[tuple[Name, Direction], PathStatistics] = {}
        self._target = target
        self._profile = profile
        self._seed = seed
        self._outages = outages
        self._deliveries = deliveries
        self._count: Counter[Name] = Counter()  # connections so far
        self._bottlenecks = {
            direction: Bottleneck(settings.rate)
            for direction in DIRECTIONS
            if (settings := profile.robot_bottleneck(direction)) is not None
        }
        self._connections: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None
        self._stack = AsyncExitStack()

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._accepted, "127.0.0.1", 0)
        self._tasks: asyncio.TaskGroup = await self._stack.enter_async_context(asyncio.TaskGroup())
        self._stack.callback(self.cut)
        self._stack.callback(self._server.close)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    @property
    def address(self) -> tuple[str, int]:
        if self._server is None:
            raise RuntimeError("enter the forwarder first")
        host, port = self._server.sockets[0].getsockname()[:2]
        return host, port

    def cut(self) -> None:
        """Break all connections at once, as a rebooting router does; new ones are taken."""
        for connection in self._connections:
            connection.cancel()

    def _accepted(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._server is None or not self._server.is_serving():
            writer.transport.abort()
            return
        connection = self._tasks.create_task(self._forward(reader, writer))
        self._connections.add(connection)
        connection.add_done_callback(self._connections.discard)

    async def _forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        bridge: asyncio.StreamWriter | None = None
        try:
            cutter, begun = await _first_messages(reader)
            async with asyncio.timeout(CONNECT_TIMEOUT):
                from_bridge, bridge = await self._connect()
            _no_delay(bridge)
            _no_delay(writer)
            to_robot, to_operator = self._paths(_path_name(begun))
            async with asyncio.TaskGroup() as ways:
                out = _Way(to_robot, bridge, self._deliveries, self._window("to_robot"))
                back = _Way(to_operator, writer, self._deliveries, self._window("to_operator"))
                ways.create_task(out.run(reader, cutter, begun))
                ways.create_task(back.run(from_bridge, _Cutter(), []))
        except (OSError, TimeoutError, ExceptionGroup):
            pass  # one side broke off or was never there: closing tells the other side
        finally:
            for each in (writer, bridge):
                if each is not None:
                    each.transport.abort()

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        if "to_operator" not in self._bottlenecks:
            return await asyncio.open_connection(*self._target)
        own = socket.socket()
        try:
            own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, LITTLE)
            own.setblocking(False)
            await asyncio.get_running_loop().sock_connect(own, self._target)
            return await asyncio.open_connection(sock=own, limit=LITTLE)
        except BaseException:
            own.close()
            raise

    def _window(self, direction: Direction) -> int:
        """Return the bytes that may be under way in one connection: those that fit the queue, as TCP finds out."""
        settings = self._profile.robot_bottleneck(direction)
        return WINDOW if settings is None else min(WINDOW, settings.queue)

    def _paths(self, name: Name) -> tuple[StreamPath, StreamPath]:
        two_way = self._profile.robot_media if name == "robot_media" else self._profile.robot_control
        self._count[name] += 1
        if not self._outages.started:
            self._outages.start(time.monotonic())

        def path(direction: Direction, back: Direction) -> StreamPath:
            made = StreamPath(
                two_way.towards(direction),
                f"{self._seed} {name} {self._count[name]} {direction}",
                back=two_way.towards(back).delay.mean,
                bottleneck=self._bottlenecks.get(direction),
                outages=self._outages,
            )
            made.statistics = self.statistics.setdefault((name, direction), made.statistics)
            return made

        return path("to_robot", "to_operator"), path("to_operator", "to_robot")


class _Cutter:
    """Cuts received bytes into frames, their lengths included; unframed bytes pass unchanged."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._framed = True

    def cut(self, data: bytes) -> Iterator[bytes]:
        self._buffer += data
        position = 0
        while self._framed and len(self._buffer) - position >= HEADER:
            length = int.from_bytes(self._buffer[position : position + HEADER], "big")
            end = position + HEADER + length
            self._framed = 0 < length <= MAX_MEDIA_FRAME
            if not self._framed or end > len(self._buffer):
                break
            yield bytes(self._buffer[position:end])
            position = end
        del self._buffer[:position]
        if not self._framed:
            yield from self.rest()

    def rest(self) -> Iterator[bytes]:
        """Yield the remaining bytes when nothing more comes."""
        if self._buffer:
            yield bytes(self._buffer)
            self._buffer.clear()


class _Way:
    """One direction of one connection."""

    def __init__(self, path: StreamPath, writer: asyncio.StreamWriter, deliveries: Deliveries, window: int) -> None:
        self._window = window
        self._path = path
        self._writer = writer
        self._deliveries = deliveries
        self._flying = 0  # bytes
        self._landed = asyncio.Event()

    async def run(self, reader: asyncio.StreamReader, cutter: _Cutter, begun: list[bytes]) -> None:
        """Forward until the sender closes; then the bytes under way arrive, and the receiver is closed too."""
        for message in begun:
            self._launch(message)
        while data := await reader.read(READ):
            for message in cutter.cut(data):
                self._launch(message)
            await self._until(self._window)
        for message in cutter.rest():
            self._launch(message)
        await self._until(0)
        self._writer.write_eof()

    def _launch(self, message: bytes) -> None:
        self._flying += len(message)
        self._deliveries.at(self._path.admit(time.monotonic(), len(message)), self._deliver, message)

    def _deliver(self, message: bytes) -> None:
        self._flying -= len(message)
        self._landed.set()
        if not self._writer.is_closing():
            self._writer.write(message)

    async def _until(self, flying: int) -> None:
        while self._flying > flying:
            self._landed.clear()
            await self._landed.wait()
        await self._writer.drain()


async def _first_messages(reader: asyncio.StreamReader) -> tuple[_Cutter, list[bytes]]:
    """Return everything up to the first whole message."""
    cutter = _Cutter()
    while True:
        data = await reader.read(READ)
        if not data:
            raise ConnectionResetError("closed before the hello")
        messages = list(cutter.cut(data))
        if messages:
            return cutter, messages


def _path_name(messages: list[bytes]) -> Name:
    with suppress(MessageError):
        hello = decode_message(messages[0][4:])
        if isinstance(hello, Hello) and hello.role == "media":
            return "robot_media"
    return "robot_control"


def _no_delay(writer: asyncio.StreamWriter) -> None:
    own: socket.socket = writer.get_extra_info("socket")
    own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
