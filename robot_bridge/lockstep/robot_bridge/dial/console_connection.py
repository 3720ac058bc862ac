"""One WebSocket from the robot to its console: through TLS, and through the HTTP proxy that the environment names."""

import asyncio
import ssl
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import cast

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.client import ClientProtocol
from websockets.exceptions import InvalidHandshake, InvalidStatus, WebSocketException
from websockets.frames import Frame, Opcode
from websockets.protocol import Event
from websockets.proxy import get_proxy
from websockets.uri import parse_uri

from lockstep.protocol.dial_in import TRUSTED, certificate_pin
from lockstep.protocol.errors import SecretError
from lockstep.protocol.pacing.paced_reader import PacedReader
from lockstep.protocol.pacing.paced_socket import PacedSocket
from lockstep.robot_bridge.dial.opening_race import late_after, open_first
from lockstep.robot_bridge.dial.tcp_race import TcpConnection, connect_first
from lockstep.robot_bridge.errors import ConsoleRefused, ConsoleUnreachable, WrongConsole
from lockstep.robot_bridge.link.websocket_transport import WebSocketTransport

__all__ = ["ConsoleConnection", "console_context", "open_connection"]

MAX_MESSAGE = 64 << 10  # bytes of one WebSocket message from the console
MAX_EARLY = 16  # messages before the link takes them; a console sends one
MAX_PINGS = 50  # while the console takes no data; their answers wait in memory
MAX_DETAIL = 300  # characters of a console's refusal that are shown


_problem = msgspec.json.Decoder(dict[str, object])


class ConsoleConnection(ClientConnection):
    """Hands binary messages to a link once `carry` was called; before that they are read with `recv`.

    Attributes:
        pin: of the certificate that the console shows; "" without TLS
        ended: set when the connection is gone
    """

    def __init__(
        self, protocol: ClientProtocol, *, expected: str | None = None, for_link: bool = False, **options: object
    ) -> None:
        """`expected`: the pin that the console must have; None: any. `for_link`: `carry` is called, never `recv`."""
        super().__init__(protocol, **options)  # type: ignore[arg-type]
        self.pin = ""
        self.ended = asyncio.Event()
        self._expected = expected
        self._for_link = for_link
        self._link: asyncio.Protocol | None = None
        self._pings: int | None = None  # since the console takes no data; None: it takes them
        self._early: list[bytes] = []  # messages that came before `carry`, as the console's hello with its answer
        self._reader = PacedReader(super().data_received)

    def carry(self, link: asyncio.Protocol) -> None:
        """Hand everything to this link from now on."""
        self._link = link
        link.connection_made(WebSocketTransport(self.transport, self.protocol))
        early, self._early = self._early, []
        for data in early:
            link.data_received(data)
        if self.ended.is_set():
            link.connection_lost(None)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(PacedSocket(cast(asyncio.Transport, transport), self._reader))
        tls = transport.get_extra_info("ssl_object")
        certificate = None if tls is None else tls.getpeercert(binary_form=True)
        if certificate is not None:
            try:
                self.pin = certificate_pin(certificate)
            except SecretError:
                self.pin = "unreadable"
        if self._expected is not None and self._expected != self.pin:
            self.transport.abort()  # before a request leaves, which would show the robot's token

    def data_received(self, data: bytes) -> None:
        self._reader.feed(data)

    def eof_received(self) -> None:
        self._reader.end()  # nothing more may come behind the end
        super().eof_received()

    def process_event(self, event: Event) -> None:
        if isinstance(event, Frame) and event.opcode is Opcode.PING and self._pings is not None:
            self._pings += 1
            if self._pings > MAX_PINGS:
                self.transport.abort()
        if not self._for_link or not isinstance(event, Frame) or event.opcode is Opcode.PONG:
            super().process_event(event)
        elif event.opcode is Opcode.TEXT or len(self._early) >= MAX_EARLY:
            self.transport.abort()  # not a console
        elif event.opcode in (Opcode.BINARY, Opcode.CONT):
            data = bytes(event.data)
            if self._link is None:
                self._early.append(data)
            else:
                self._link.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._reader.end()
        super().connection_lost(exc)
        if self._link is not None:
            self._link.connection_lost(exc)
        self.ended.set()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._pings = 0
        if self._link is not None:
            self._link.pause_writing()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._pings = None
        if self._link is not None:
            self._link.resume_writing()


def console_context(pin: str, authority: Path | None) -> ssl.SSLContext:
    """Return the context for a console with this pin; it checks the certificate only for `TRUSTED`.

    Raises:
        SecretError: the authority's file cannot be used.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2  # proxies in front of consoles
    if pin != TRUSTED:  # the pin takes the place of the check by an authority
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        return context
    try:
        if authority is None:
            context.load_default_certs()
        else:
            context.load_verify_locations(authority)
    except (OSError, ValueError) as error:
        raise SecretError(f"cannot use the authority of the console's certificate: {error}") from error
    return context


async def open_connection(
    url: str,
    context: ssl.SSLContext | None,
    *,
    expected: str | None = None,
    headers: Mapping[str, str] | None = None,
    seconds: float = 8.0,
    for_link: bool = False,
) -> ConsoleConnection:
    """Open a WebSocket.

    Args:
        context: None without TLS
        expected: the pin that the console must have; None: any that the context takes
        for_link: a link is to `carry` it

    Raises:
        ConsoleUnreachable: there is no way to it, or no console answers there.
        WrongConsole: its certificate is not the one that it should have.
        ConsoleRefused: it answered, and refused.
    """
    made: list[ConsoleConnection] = []

    async def open_one(on_its_way: Callable[[float], None]) -> ClientConnection:
        mine: list[ConsoleConnection] = []

        def create(protocol: ClientProtocol, **options: object) -> ConsoleConnection:
            mine.append(ConsoleConnection(protocol, expected=expected, for_link=for_link, **options))
            made.extend(mine)
            return mine[0]

        tcp = await _direct(url)
        if tcp is not None:
            on_its_way(late_after(tcp.seconds))
        try:
            return await connect(
                url,
                sock=None if tcp is None else tcp.socket,
                ssl=context,
                additional_headers=dict(headers or {}),
                compression=None,  # media are compressed already
                open_timeout=None,
                ping_interval=None,  # links have their own
                close_timeout=1.0,
                max_size=MAX_MESSAGE,
                create_connection=cast(type[ClientConnection], create),
            )
        finally:
            if tcp is not None and not mine:
                tcp.socket.close()

    try:
        async with asyncio.timeout(seconds):
            opened = await open_first(open_one, lambda other: other.transport.abort())
    except InvalidStatus as error:
        raise _refusal(error) from error
    except ssl.SSLCertVerificationError as error:
        raise WrongConsole(f"the console's certificate is not trusted ({error.verify_message})") from error
    except (OSError, TimeoutError, InvalidHandshake, WebSocketException, EOFError, ValueError) as error:
        wrong = [each.pin for each in made if expected is not None and each.pin not in ("", expected)]
        if wrong:
            raise WrongConsole(
                f"another console answers at {url}: its key is {wrong[-1]}, the robot's console has {expected}"
            ) from error
        raise ConsoleUnreachable(f"{url}: {str(error) or 'no answer'}") from error
    return cast(ConsoleConnection, opened)


async def _direct(url: str) -> TcpConnection | None:
    """Return a TCP connection to the console; None if the environment names a proxy for it."""
    where = parse_uri(url)
    return None if get_proxy(where) is not None else await connect_first(where.host, where.port)


def _refusal(error: InvalidStatus) -> ConsoleRefused:
    """Return the refusal with the console's own words, if it has sent a problem (RFC 9457)."""
    status, body = error.response.status_code, error.response.body or b""
    try:
        problem = _problem.decode(bytes(body[:4096]))
    except msgspec.MsgspecError:
        problem = {}
    name = str(problem.get("error") or problem.get("title") or f"http_{status}")
    detail = str(problem.get("detail") or f"the console answered with HTTP status {status}")
    return ConsoleRefused(f"{name[:60]}: {detail[:MAX_DETAIL]}", status)
