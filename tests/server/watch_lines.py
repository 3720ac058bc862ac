"""Observers behind a relay in tests: tickets, and lines that keep all they hear."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from lockstep.protocol.console import ClientMessage, ServerMessage, decode_server_message
from lockstep.protocol.console import encode_console_message as encode
from tests.server.rig import PATIENCE, Rig

__all__ = ["NOWHERE", "TestLine", "address", "joined", "open_line", "ticket"]

NOWHERE = "janus:ws://127.0.0.1:9/4711"  # nobody listens on the discard port; lines need no relay that lives


async def ticket(rig: Rig, headers: dict[str, str] | None = None) -> str:
    answer = await rig.http.post("/api/watch?relay=0", headers=headers or rig.token("observer"))
    assert answer.status_code == 201, answer.text
    found: str = answer.json()["ticket"]
    return found


def address(rig: Rig, used: str) -> str:
    return f"{rig.url.replace('http', 'ws', 1)}/watch/{used}"


class TestLine:
    """Speaks on one line."""

    __test__ = False

    def __init__(self, socket: ClientConnection, headers: dict[str, str]) -> None:
        self.socket = socket
        self.headers = headers  # with its token
        self.heard: list[ServerMessage] = []

    async def send(self, message: ClientMessage) -> None:
        await self.socket.send(encode(message))

    async def until(self, found: Callable[[ServerMessage], bool]) -> ServerMessage:
        """The first message, heard already or to come, that `found` says yes to."""
        for message in self.heard:
            if found(message):
                return message
        async with asyncio.timeout(PATIENCE):
            while True:
                message = decode_server_message(await self.socket.recv())
                self.heard.append(message)
                if found(message):
                    return message

    async def ended(self) -> tuple[int | None, str | None]:
        """Code and reason with which the console closed it."""
        async with asyncio.timeout(PATIENCE):
            try:
                while True:
                    self.heard.append(decode_server_message(await self.socket.recv()))
            except ConnectionClosed:
                return self.socket.close_code, self.socket.close_reason


@asynccontextmanager
async def joined(url: str) -> AsyncIterator[ClientConnection]:
    async with connect(url, proxy=None, ping_interval=None, close_timeout=1.0) as socket:
        yield socket


@asynccontextmanager
async def open_line(rig: Rig, headers: dict[str, str] | None = None) -> AsyncIterator[TestLine]:
    headers = headers or rig.token("observer")
    async with joined(address(rig, await ticket(rig, headers))) as socket:
        yield TestLine(socket, headers)
