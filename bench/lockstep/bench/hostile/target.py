"""The crowd's target, and the requests by which a member attacks it."""

import asyncio
import ssl
from collections import Counter
from collections.abc import Awaitable, Callable
from random import Random
from typing import NamedTuple
from urllib.parse import urlsplit

import httpx

__all__ = ["Misbehaviour", "Target"]


class Target(NamedTuple):
    """A console, and tokens: the worst of the crowd are people with a link."""

    url: str
    token: str  # an observer's
    operator: str  # an operator's, who publishes a camera and speaks
    bridge: tuple[str, int]  # address of the robot's bridge, which listens with TLS
    http: httpx.AsyncClient
    seen: Counter[str]  # the console's answers, by name or status

    @property
    def address(self) -> tuple[str, int]:
        parts = urlsplit(self.url)
        return parts.hostname or "", parts.port or (443 if parts.scheme == "https" else 80)

    async def connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Open a TCP connection, with TLS if the console or the proxy before it speaks that."""
        host, port = self.address
        if not self.url.startswith("https"):
            return await asyncio.open_connection(host, port)
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        return await asyncio.open_connection(host, port, ssl=context, server_hostname=host)

    @property
    def headers(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"}

    async def ask(self, method: str, path: str, content: str | bytes = b"", **headers: str) -> httpx.Response:
        """Ask with the observer's token, and count the answer."""
        return await self._ask(method, path, content, {**self.headers, **headers})

    async def ask_as_operator(
        self, method: str, path: str, content: str | bytes = b"", **headers: str
    ) -> httpx.Response:
        """Ask with the operator's token, and count the answer."""
        return await self._ask(method, path, content, {"Authorization": f"Bearer {self.operator}", **headers})

    async def publish(self, offer: str, **headers: str) -> httpx.Response:
        """Offer a camera with the operator's token, and count the answer."""
        return await self.ask_as_operator("POST", "/whip", offer, **headers)

    async def _ask(self, method: str, path: str, content: str | bytes, headers: dict[str, str]) -> httpx.Response:
        answer = await self.http.request(method, path, content=content, headers=headers)
        self.note(answer)
        return answer

    def note(self, answer: httpx.Response) -> None:
        name = str(answer.status_code)
        if answer.status_code >= 400 and answer.headers.get("content-type", "").startswith("application/problem+json"):
            name = answer.json().get("error", name)
        self.seen[name] += 1


Misbehaviour = Callable[[Target, Random], Awaitable[None]]  # one attempt; the crowd makes the next
