"""Bounds on WebSocket connections that uvicorn does not have: frames, fragments, and the time of closing.

A client that sends pings and reads no answers would fill the write buffer; one that sends empty fragments, the list of
them; one that reads nothing would keep a connection that has ended. uvicorn parses all that it has received at once: a
single read holds tens of thousands of empty frames, which take the loop a tenth of a second and more.
"""

import asyncio
import socket
from typing import Any, cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.http11 import Request

from lockstep.protocol.dial_in import DIAL
from lockstep.protocol.pacing.paced_reader import READ_BURST, READ_SHARE, PacedReader
from lockstep.protocol.pacing.paced_socket import PacedSocket
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.link.websocket_transport import WebSocketTransport
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.http.robot_paths import below_robot
from lockstep.server.util.read_turns import ReadTurns

__all__ = ["CLOSED_FOR", "LINES", "SOCKET", "BoundedWebSocket", "bounded_websocket"]

SOCKET = "lockstep.socket"  # key of a dialled connection's `BoundedWebSocket` in the scope's extensions

LINES = "/watch/"  # paths of observers' WebSockets (server/lockstep/server/routes/observer_websocket.py)
LINE_BUFFER = 64 * 1024  # bytes that the kernel keeps for one that does not read; Linux doubles it
SHARE, BURST = 0.05, 0.05  # of the thread's time, and s of it at once, for what one client sends to the app
ALL_SHARE, ALL_BURST = 0.15, 0.01  # the same for what all clients send, but for robots that were admitted
FRAME_RATE, FRAME_BURST = 200.0, 1000.0  # Hz, of messages and their fragments; empty ones count
LINK_RATE, LINK_BURST = 20_000.0, 20_000.0  # the same for a robot: raw pictures of 5 Gbit/s
CONTROL_RATE, CONTROL_BURST = 5.0, 50.0  # Hz, of pings and pongs
MAX_FRAGMENTS = 64  # of one message
GOODBYE_SECONDS = 3.0  # from the console's end of a connection until it is aborted
LAST_WORDS = 16 * 1024  # bytes that are read after the console's close frame, to find the client's
CLOSED_FOR = {1007: "not_utf8", 1008: "too_many_frames", 1009: "too_large"}  # RFC 6455 7.4.1
UNSUPPORTED, NOT_UTF8, TOO_MANY_FRAMES, TOO_LARGE = 1003, 1007, 1008, 1009


class BoundedWebSocket(WebSocketsSansIOProtocol):
    """What comes is parsed in small pieces, and no more of it than the connection's share of the thread's time allows.

    Nothing is parsed before the app has accepted the connection, while a message waits for the app, or after the end.
    """

    turns: ReadTurns | None = None  # of all connections of a server; None: this one's share alone bounds it
    _goodbye: asyncio.TimerHandle | None = None
    _link: asyncio.Protocol | None = None  # the robot link that the connection carries, past the app
    _reader: PacedReader
    _frames: TokenBucket
    _control: TokenBucket
    _bytes_left: int | None = None  # None: as many as there is time for
    _frames_left: int | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._frames, self._control = TokenBucket(FRAME_RATE, FRAME_BURST), TokenBucket(CONTROL_RATE, CONTROL_BURST)
        self._reader = PacedReader(self._parse, share=SHARE, burst=BURST, turns=self.turns)
        super().connection_made(PacedSocket(cast(asyncio.Transport, transport), self._reader))

    def data_received(self, data: bytes) -> None:
        if self._has_request():
            self._reader.feed(data)
            return
        super().data_received(data)  # the request, whole and alone, as HTTP has read it
        if self._has_request():
            self.transport.pause_reading()  # until the app accepts
        else:
            self.transport.abort()  # this parser does not take the request, and would say nothing

    def _has_request(self) -> bool:
        return self.handshake_initiated

    def _parse(self, data: bytes) -> None:
        left = self._bytes_left
        if left is not None and len(data) > left:
            if self.close_sent:
                self.transport.abort()
            else:
                self._refuse(TOO_LARGE, "too large")
            return
        if left is not None:
            self._bytes_left = left - len(data)
        super().data_received(data)

    def expect(self, *, messages: int, size: int) -> None:
        """Take so many messages, of so many bytes together, and refuse the client that sends more."""
        self._frames_left, self._bytes_left = messages, size

    def carry(self, link: asyncio.Protocol) -> None:
        """Hand all binary messages to a link from now on, within the turn of the loop in which they come.

        Raises ConnectionResetError: the robot has closed the connection.
        """
        if self.disconnected or self.close_sent or self.transport.is_closing():
            raise ConnectionResetError("the robot has closed the connection meanwhile")
        self._link = link
        self._frames = TokenBucket(LINK_RATE, LINK_BURST)
        self._reader.allow(READ_SHARE, READ_BURST)
        link.connection_made(WebSocketTransport(self.transport, self.conn))
        if self.read_paused:  # a message came before the link, which no robot sends
            self.transport.abort()

    def handle_connect(self, event: Request) -> None:
        if below_robot(event.path).startswith(DIAL):
            self.conn.available_extensions = []  # media are compressed already
            super().handle_connect(event)
            if hasattr(self, "scope"):  # it was a proper request
                cast(dict[str, object], self.scope["extensions"])[SOCKET] = self
            return
        if below_robot(event.path).startswith(LINES):
            # Short messages now and then: a compressor for each would cost more than it saves.
            self.conn.available_extensions = []
            connected = self.transport.get_extra_info("socket")
            if connected is not None:
                connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LINE_BUFFER)
        super().handle_connect(event)

    def handle_ping(self) -> None:
        if self._has_room(self._control):
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        if self._has_room(self._control):
            super().handle_pong(event)

    def handle_text(self, event: Frame) -> None:
        if self._has_room(self._frames):
            super().handle_text(event)

    def handle_bytes(self, event: Frame) -> None:
        if self._has_room(self._frames):
            super().handle_bytes(event)

    def handle_cont(self, event: Frame) -> None:
        if len(self.frames) >= MAX_FRAGMENTS:
            self._refuse(TOO_MANY_FRAMES, "too many fragments")
        elif self._has_room(self._frames):
            super().handle_cont(event)

    def send_receive_event_to_app(self) -> None:
        if self._link is not None:
            self._hand_over(self._link)
        elif self.curr_msg_data_type == "text" and not _is_utf8(b"".join(self.frames)):
            self._refuse(NOT_UTF8, "not UTF-8")
        else:
            super().send_receive_event_to_app()

    def shutdown(self) -> None:
        """Close the connection because the console ends. A robot hears that from its link, and is free at once."""
        if self._link is None:
            super().shutdown()
            return
        if isinstance(self._link, LinkTransport):
            self._link.end("closing", "the console ends")
        self.stop_keepalive()
        self.transport.close()  # what was written leaves first

    def _hand_over(self, link: asyncio.Protocol) -> None:
        data, self.frames = b"".join(self.frames), []
        if self.curr_msg_data_type == "text":
            self._refuse(UNSUPPORTED, "a robot link is binary")
        elif not self.close_sent:
            link.data_received(data)

    def pause_writing(self) -> None:
        super().pause_writing()
        if self._link is not None:
            self._link.pause_writing()

    def resume_writing(self) -> None:
        super().resume_writing()
        if self._link is not None:
            self._link.resume_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        self._reader.end()
        if self._goodbye is not None:
            self._goodbye.cancel()
        super().connection_lost(exc)
        if self._link is not None:
            self._link.connection_lost(exc)

    async def receive(self) -> Any:  # uvicorn's type of it is private
        """Return the next message for the app, in a turn of the loop of its own."""
        if not self.queue.empty():
            await asyncio.sleep(0)  # reading on would take no turn, for hundreds of short messages
        return await super().receive()

    async def send(self, message: Any) -> None:  # uvicorn's type of it is private
        """Send a message of the app. A refusal that has left ends the handshake; uvicorn would log an error for each.

        Strangers are refused so, and would fill the log.
        """
        await super().send(message)
        match message["type"]:
            case "websocket.accept":
                self.transport.resume_reading()
            case "websocket.close":
                self._bytes_left = LAST_WORDS if self._bytes_left is None else min(self._bytes_left, LAST_WORDS)
            case "websocket.http.response.body" if not message.get("more_body", False):
                self.handshake_complete = True

    async def run_asgi(self) -> None:
        try:
            await super().run_asgi()
        finally:
            if not self.disconnected:
                self._drop_soon()

    def _has_room(self, bucket: TokenBucket) -> bool:
        """Return whether a frame may be handled. A client that sends too many of them is refused."""
        if self.close_sent:
            return False
        if bucket is self._frames and self._frames_left is not None:
            self._frames_left -= 1
        if not bucket.take(self.loop.time()) or (self._frames_left is not None and self._frames_left < 0):
            self._refuse(TOO_MANY_FRAMES, "too many frames")
            return False
        return True

    def _refuse(self, code: int, reason: str) -> None:
        """Close the connection for a fault; discard what has already come with it."""
        if not self.close_sent and not self.transport.is_closing():
            self.frames = []
            self.conn.fail(code, reason)
            self.handle_parser_exception()
            self._drop_soon()

    def _drop_soon(self) -> None:
        """Abort the connection in `GOODBYE_SECONDS`, even if the client does not read."""
        if self._goodbye is None:
            self._goodbye = self.loop.call_later(GOODBYE_SECONDS, self.transport.abort)


def bounded_websocket() -> type[BoundedWebSocket]:
    """Return the class of one server's connections, which share a bound for all of them together."""

    class Bounded(BoundedWebSocket):
        turns = ReadTurns(ALL_SHARE, ALL_BURST)

    return Bounded


def _is_utf8(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True
