"""A reverse proxy in front of a console: through it an unmodified browser or client meets a network.

HTTP and the 3D scene's WebSocket take the signalling path's time: one delay for a request and one for its answer;
connections are taken as open. Each WHEP session gets its own forwarder, which is written into offer and answer.
"""

import time
from collections.abc import AsyncIterator
from contextlib import aclosing
from urllib.parse import urlsplit

import httpx
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from lockstep.emulator.errors import BadDescription
from lockstep.emulator.transport.client_paths import SignallingPaths
from lockstep.emulator.transport.delayed import delayed, sleep_until
from lockstep.emulator.transport.sdp import without_candidates
from lockstep.emulator.transport.sessions import Sessions
from lockstep.emulator.transport.stream_path import StreamPath
from lockstep.emulator.transport.websocket_proxy import join

__all__ = ["ConsoleProxy"]

# Hop-by-hop headers (RFC 9110 7.6.1).
NOT_FORWARDED = frozenset(
    ("connection", "keep-alive", "proxy-authenticate", "proxy-connection", "te", "trailer", "transfer-encoding")
)
METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]
SDP = "application/sdp"
FRAGMENT = "application/trickle-ice-sdpfrag"
TIMEOUT = 120.0  # s; an outage must not end a request
HEADERS_SIZE = 400  # bytes, about, of a request's or an answer's headers


class ConsoleProxy:
    """A proxy; `app` is its application. Close it at the end.

    `Host` and `Origin` pass unchanged: to the console its page comes from the proxy's address, and both agree.
    """

    def __init__(self, console: str, sessions: Sessions, paths: SignallingPaths) -> None:
        self._console = console.rstrip("/")
        self._sessions = sessions
        self._paths = paths
        # The console's own certificate may be self-signed, and no other host is between it and this process.
        self._upstream = httpx.AsyncClient(
            base_url=self._console, timeout=TIMEOUT, trust_env=False, verify=False, limits=httpx.Limits()
        )
        self.app = Starlette(
            routes=[Route("/{path:path}", self._http, methods=METHODS), WebSocketRoute("/{path:path}", self._websocket)]
        )

    async def close(self) -> None:
        await self._upstream.aclose()

    async def _http(self, request: Request) -> Response:
        body = await request.body()
        paths = self._paths.of(request.client)
        await sleep_until(paths["to_robot"].admit(time.monotonic(), HEADERS_SIZE + len(body)))
        kind = request.headers.get("content-type", "").partition(";")[0].strip()
        try:
            if request.method == "POST" and request.url.path == "/whep" and kind == SDP:
                response = await self._new_session(request, body)
            elif request.method == "PATCH" and kind == FRAGMENT:
                response = await self._more_candidates(request, body)
            else:
                response = await self._forward(request, body)
        except httpx.TransportError as error:
            response = PlainTextResponse(f"the console does not answer: {error or type(error).__name__}", 502)
        await sleep_until(paths["to_operator"].admit(time.monotonic(), HEADERS_SIZE))
        if request.method == "DELETE" and response.status_code < 400:
            self._sessions.end(request.url.path)
        return response

    async def _new_session(self, request: Request, body: bytes) -> Response:
        forwarder = self._sessions.open()
        kept = False
        try:
            offer = forwarder.offer(body.decode("utf-8", "replace"))
            answer = await self._ask(request, offer.encode())
            text = await answer.aread()
            await answer.aclose()
            if answer.status_code == 201:
                text = forwarder.answer(text.decode()).encode()
                self._sessions.keep(urlsplit(answer.headers.get("location", "")).path, forwarder)
                kept = True
            response = Response(text, answer.status_code)
        except BadDescription as error:
            return PlainTextResponse(str(error), 502)
        finally:
            if not kept:
                forwarder.close()
        self._copy_headers(answer, response, {"content-length", "content-encoding"})
        return response

    async def _more_candidates(self, request: Request, body: bytes) -> Response:
        """Pass trickle ICE, without its candidates, or an ICE restart, which is led through the forwarder as well."""
        forwarder = self._sessions.find(request.url.path)
        fragment = body.decode("utf-8", "replace")
        sent = without_candidates(fragment) if forwarder is None else forwarder.offer(fragment)
        answer = await self._ask(request, sent.encode())
        text = await answer.aread()
        await answer.aclose()
        if forwarder is not None and answer.status_code == 200:
            try:
                text = forwarder.answer(text.decode()).encode()
            except BadDescription as error:
                return PlainTextResponse(str(error), 502)
        response = Response(text, answer.status_code)
        self._copy_headers(answer, response, {"content-length", "content-encoding"})
        return response

    async def _forward(self, request: Request, body: bytes) -> Response:
        answer = await self._ask(request, body)
        response = StreamingResponse(
            self._body(answer, self._paths.of(request.client)["to_operator"]), answer.status_code
        )
        self._copy_headers(answer, response, set())
        return response

    async def _body(self, answer: httpx.Response, path: StreamPath) -> AsyncIterator[bytes]:
        async with aclosing(answer), aclosing(delayed(answer.aiter_raw(), path)) as chunks:
            async for chunk in chunks:
                yield chunk

    async def _ask(self, request: Request, body: bytes) -> httpx.Response:
        left_out = NOT_FORWARDED | {"content-length", "upgrade"}
        headers = [(name, value) for name, value in request.headers.items() if name not in left_out]
        path: bytes = request.scope["raw_path"]
        url = path.decode() + (f"?{request.url.query}" if request.url.query else "")
        asked = self._upstream.build_request(request.method, url, headers=headers, content=body)
        return await self._upstream.send(asked, stream=True)

    def _copy_headers(self, answer: httpx.Response, response: Response, left_out: set[str]) -> None:
        for name, value in answer.headers.multi_items():
            if name in NOT_FORWARDED or name in left_out:
                continue
            if name == "location":
                value = value.removeprefix(self._console)
            response.headers.append(name, value)

    async def _websocket(self, browser: WebSocket) -> None:
        await join(browser, self._console, self._paths.of(browser.client))
