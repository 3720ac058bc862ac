"""The transports: two TLS connections over TCP as the robot's link has today, QUIC's streams, and QUIC's datagrams."""

import asyncio
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Literal, Protocol

from aioquic.asyncio.client import connect
from aioquic.asyncio.protocol import QuicConnectionProtocol
from aioquic.asyncio.server import serve
from aioquic.quic.configuration import QuicConfiguration
from aioquic.quic.events import DatagramFrameReceived, QuicEvent, StreamDataReceived

from lockstep.bench.link_transports.messages import Message, take_frames

__all__ = ["KINDS", "Ends", "Kind", "Link", "console_link", "robot_link"]

Kind = Literal["tls", "tls-asked", "quic-streams", "quic-datagrams"]
Pair = tuple[asyncio.StreamReader, asyncio.StreamWriter]
KINDS: tuple[Kind, ...] = ("tls", "tls-asked", "quic-streams", "quic-datagrams")
OVER_TCP: tuple[Kind, ...] = ("tls", "tls-asked")
ALPN = ["lockstep-bench"]
LARGE = 1 << 26  # bytes: flow control is never what bounds
READ = 1 << 16
CONNECT_SECONDS = 20.0


class Ends(Protocol):
    """Takes the messages that arrive at one end."""

    def control(self, message: Message) -> None: ...
    def picture(self, message: Message) -> None: ...


class Link(Protocol):
    """Sends without waiting."""

    def send_control(self, data: bytes) -> None: ...
    def send_picture(self, data: bytes) -> None: ...


class TlsLink:
    """Control on one connection, pictures on another."""

    def __init__(self, control: asyncio.StreamWriter, media: asyncio.StreamWriter) -> None:
        self._control = control
        self._media = media

    def send_control(self, data: bytes) -> None:
        self._control.write(data)

    def send_picture(self, data: bytes) -> None:
        self._media.write(data)


async def _read(reader: asyncio.StreamReader, take: Callable[[Message], None]) -> None:
    waiting = bytearray()
    while data := await reader.read(READ):
        waiting += data
        for message in take_frames(waiting):
            take(message)


class QuicLink(QuicConnectionProtocol):
    """Control on one stream or in datagrams; each picture on a stream of its own, so that none waits for another."""

    def __init__(self, *args: Any, ends: Ends, datagrams: bool, made: "asyncio.Future[QuicLink]", **more: Any) -> None:
        super().__init__(*args, **more)
        self._ends = ends
        self._datagrams = datagrams
        self._made = made
        self._stream: int | None = None  # of control
        self._waiting: dict[int, bytearray] = {}

    def send_control(self, data: bytes) -> None:
        if self._datagrams:
            self._quic.send_datagram_frame(data)
        else:
            if self._stream is None:
                self._stream = self._quic.get_next_available_stream_id()
            self._quic.send_stream_data(self._stream, data)
        self.transmit()

    def send_picture(self, data: bytes) -> None:
        stream = self._quic.get_next_available_stream_id(is_unidirectional=True)
        self._quic.send_stream_data(stream, data, end_stream=True)
        self.transmit()

    def quic_event_received(self, event: QuicEvent) -> None:
        if isinstance(event, DatagramFrameReceived):
            for message in take_frames(bytearray(event.data)):
                self._ends.control(message)
        elif isinstance(event, StreamDataReceived):
            waiting = self._waiting.setdefault(event.stream_id, bytearray())
            waiting += event.data
            is_media = bool(event.stream_id & 2)  # unidirectional (RFC 9000 2.1)
            if not is_media and self._stream is None:
                self._stream = event.stream_id
            for message in take_frames(waiting):
                (self._ends.picture if is_media else self._ends.control)(message)
            if event.end_stream:
                del self._waiting[event.stream_id]
        if not self._made.done():
            self._made.set_result(self)


def _configuration(*, is_client: bool) -> QuicConfiguration:
    return QuicConfiguration(
        is_client=is_client,
        alpn_protocols=ALPN,
        congestion_control_algorithm="cubic",  # as Linux' TCP
        max_datagram_frame_size=65_536,
        max_data=LARGE,
        max_stream_data=LARGE,
    )


@asynccontextmanager
async def console_link(
    kind: Kind, host: str, port: int, chain: Path, key: Path, ends: Ends, listening: Callable[[], None]
) -> AsyncIterator[Link]:
    """Listen, call `listening`, and yield the link once the robot has connected."""
    loop = asyncio.get_running_loop()
    if kind not in OVER_TCP:
        made: asyncio.Future[QuicLink] = loop.create_future()
        configuration = _configuration(is_client=False)
        configuration.load_cert_chain(chain, key)

        def protocol(*args: Any, **more: Any) -> QuicLink:
            return QuicLink(*args, ends=ends, datagrams=kind == "quic-datagrams", made=made, **more)

        server = await serve(host, port, configuration=configuration, create_protocol=protocol)
        listening()
        try:
            yield await asyncio.wait_for(made, CONNECT_SECONDS)
        finally:
            server.close()
        return
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(chain, key)
    queues = [asyncio.Queue[Pair]() for _ in range(2)]
    servers = [
        await asyncio.start_server(_taker(queue), host, port + number, ssl=context)
        for number, queue in enumerate(queues)
    ]
    listening()
    async with asyncio.timeout(CONNECT_SECONDS):
        pairs = [await queue.get() for queue in queues]
    async with _reading(pairs, ends) as link:
        yield link
    for each in servers:
        each.close()


def _taker(queue: asyncio.Queue[Pair]) -> Callable[[asyncio.StreamReader, asyncio.StreamWriter], None]:
    return lambda reader, writer: queue.put_nowait((reader, writer))


@asynccontextmanager
async def robot_link(kind: Kind, host: str, port: int, chain: Path, ends: Ends) -> AsyncIterator[Link]:
    """Connect to the console."""
    if kind not in OVER_TCP:
        made: asyncio.Future[QuicLink] = asyncio.get_running_loop().create_future()
        configuration = _configuration(is_client=True)
        configuration.load_verify_locations(str(chain))

        def protocol(*args: Any, **more: Any) -> QuicLink:
            return QuicLink(*args, ends=ends, datagrams=kind == "quic-datagrams", made=made, **more)

        async with connect(host, port, configuration=configuration, create_protocol=protocol) as link:
            assert isinstance(link, QuicLink)
            yield link
        return
    context = ssl.create_default_context(cafile=str(chain))
    pairs = [await asyncio.open_connection(host, port + number, ssl=context) for number in range(2)]
    async with _reading(pairs, ends) as found:
        yield found


@asynccontextmanager
async def _reading(pairs: list[Pair], ends: Ends) -> AsyncIterator[Link]:
    (control, control_writer), (media, media_writer) = pairs
    async with asyncio.TaskGroup() as tasks:
        reading = [
            tasks.create_task(_read(control, ends.control)),
            tasks.create_task(_read(media, ends.picture)),
        ]
        yield TlsLink(control_writer, media_writer)
        for task in reading:
            task.cancel()
        for writer in (control_writer, media_writer):
            writer.transport.abort()
