"""Bounds on WebSocket connections that uvicorn does not have: control frames, fragments, and the time of closing.

A client that sends pings and reads no answers would fill the write buffer; one that sends empty fragments, the list of
them; one that reads nothing would keep a connection that has ended.
"""

import asyncio
import socket
from typing import Any, cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.http11 import Request

from lockstep.protocol.dial_in import DIAL
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.link.websocket_transport import WebSocketTransport
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.http.robot_paths import below_robot

__all__ = ["LINES", "SOCKET", "TOO_MANY_FRAMES", "GuardedWebSocket"]

SOCKET = "lockstep.socket"  # key of a dialled connection's `GuardedWebSocket` in the scope's extensions

LINES = "/watch/"  # paths of observers' WebSockets (server/lockstep/server/routes/observer_websocket.py)
LINE_BUFFER = 64 * 1024  # bytes that the kernel keeps for one that does not read; Linux doubles it
CONTROL_RATE, CONTROL_BURST = 5.0, 50.0  # Hz, of pings and pongs
MAX_FRAGMENTS = 64  # of one message
GOODBYE_SECONDS = 3.0  # from the console's end of a connection until it is aborted
TOO_MANY_FRAMES = 1008  # RFC 6455 7.4.1
UNSUPPORTED = 1003
NOT_UTF8 = 1007


class GuardedWebSocket(WebSocketsSansIOProtocol):
    _goodbye: asyncio.TimerHandle | None = None
    _control: TokenBucket | None = None
    _link: asyncio.Protocol | None = None  # the robot link that the connection carries, past the app

    def carry(self, link: asyncio.Protocol) -> None:
        """Hand all binary messages to a link from now on, within the turn of the loop in which they come.

        Raises ConnectionResetError: the robot has closed the connection.
        """
        if self.disconnected or self.close_sent or self.transport.is_closing():
            raise ConnectionResetError("the robot has closed the connection meanwhile")
        self._link = link
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
        if self._too_many_control_frames():
            self._refuse(TOO_MANY_FRAMES, "too many frames")
        else:
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        if self._too_many_control_frames():
            self._refuse(TOO_MANY_FRAMES, "too many frames")
        else:
            super().handle_pong(event)

    def handle_cont(self, event: Frame) -> None:
        if len(self.frames) >= MAX_FRAGMENTS:
            self._refuse(TOO_MANY_FRAMES, "too many fragments")
        else:
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
        if self._goodbye is not None:
            self._goodbye.cancel()
        super().connection_lost(exc)
        if self._link is not None:
            self._link.connection_lost(exc)

    async def send(self, message: Any) -> None:  # uvicorn's type of it is private
        """Send a message of the app. A refusal that has left ends the handshake; uvicorn would log an error for each.

        Strangers are refused so, and would fill the log.
        """
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True

    async def run_asgi(self) -> None:
        try:
            await super().run_asgi()
        finally:
            if not self.disconnected:
                self._drop_soon()

    def _too_many_control_frames(self) -> bool:
        if self._control is None:
            self._control = TokenBucket(CONTROL_RATE, CONTROL_BURST)
        return not self._control.take(self.loop.time())

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


def _is_utf8(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True
