"""The proxy in front of a small app that stands in for a console."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from lockstep.emulator import Impairment, Network, Profile, even_profile
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.transport import websocket_proxy
from lockstep.server.http.transport.serve import bind, running
from tests.server.rig import eventually
from tests.support.websockets_made import keep_websockets

SDP = {"Content-Type": "application/sdp", "Authorization": "Bearer t"}
FRAGMENT = {"Content-Type": "application/trickle-ice-sdpfrag", "If-Match": "*"}
OFFER = "v=0\r\na=ice-ufrag:cccc\r\nm=audio 9 X\r\na=candidate:1 1 udp 1 192.0.2.9 4000 typ host\r\n"
ANSWER = "v=0\r\na=ice-ufrag:aaaa\r\nm=audio 9 X\r\na=candidate:1 1 udp 1 127.0.0.1 4000 typ host\r\n"


class Console:
    """What was asked, and what is answered."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str, str]] = []  # method, path and query, body
        self.headers: list[dict[str, str]] = []
        self.answer = ANSWER
        self.status = 201
        self.delete_status = 200

    async def any(self, request: Request) -> Response:
        query = f"?{request.url.query}" if request.url.query else ""
        self.asked.append((request.method, request.url.path + query, (await request.body()).decode()))
        self.headers.append(dict(request.headers))
        if request.url.path.startswith("/whep") and request.method in ("POST", "PATCH"):
            return Response(
                self.answer, self.status, {"Location": "/whep/1", "ETag": '"e"'}, media_type="application/sdp"
            )
        if request.method == "DELETE":
            return Response(None, self.delete_status)
        if request.url.path == "/stream":
            return StreamingResponse(self._chunks(), media_type="text/plain")
        if request.url.path == "/moved":
            return Response(None, 302, {"Location": f"http://{request.headers['host']}/there"})
        return JSONResponse({"hello": "there"}, headers={"X-Own": "yes"})

    async def flood(self, websocket: WebSocket) -> None:
        await websocket.accept()
        while True:
            await websocket.send_bytes(bytes(100_000))

    async def _chunks(self) -> AsyncIterator[bytes]:
        for number in range(200):
            yield b"%d " % number

    async def echo(self, websocket: WebSocket) -> None:
        if websocket.query_params.get("no"):
            await websocket.close(1008)
            return
        offered = websocket.scope["subprotocols"]
        await websocket.accept(subprotocol=offered[0] if offered else None)
        await websocket.send_text(websocket.headers["origin"])
        await websocket.send_bytes(await websocket.receive_bytes())
        await websocket.send_text(await websocket.receive_text())
        await websocket.close()

    @property
    def app(self) -> Starlette:
        methods = ["GET", "POST", "PATCH", "DELETE"]
        websockets = [WebSocketRoute("/echo", self.echo), WebSocketRoute("/flood", self.flood)]
        return Starlette(routes=[*websockets, Route("/{path:path}", self.any, methods=methods)])


@asynccontextmanager
async def proxied(profile: Profile | None = None) -> AsyncIterator[tuple[Console, Network, httpx.AsyncClient]]:
    console, listener = Console(), bind("127.0.0.1", 0)
    url = "http://{}:{}".format(*listener.getsockname())
    async with (
        running(console.app, listener),
        Network(profile or even_profile("x", Impairment()), console_url=url, hosts=["127.0.0.1"]) as network,
        httpx.AsyncClient(base_url=network.console_url, trust_env=False) as browser,
    ):
        yield console, network, browser
    listener.close()


def port_in(sdp: str) -> int:
    return int(sdp.split(" typ host")[0].rsplit(" ", 1)[1])


def is_taken(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind(("127.0.0.1", port))
        except OSError:
            return True
        return False


async def test_requests_and_answers_pass_with_their_headers() -> None:
    async with proxied() as (console, network, browser):
        answer = await browser.post("/api/x?a=b%20c", content=b"body", headers={"Origin": network.console_url})
        assert answer.json() == {"hello": "there"}
        assert answer.headers["x-own"] == "yes"
        assert console.asked == [("POST", "/api/x?a=b%20c", "body")]
        seen = console.headers[0]
        assert seen["origin"] == f"http://{seen['host']}" == network.console_url, "it is not another site's page"


async def test_an_answer_that_comes_in_pieces_arrives_whole() -> None:
    async with proxied(even_profile("slow", Impairment(delay=Constant(0.005)))) as (_, _, browser):
        assert (await browser.get("/stream")).text == "".join(f"{number} " for number in range(200))


async def test_a_console_that_is_not_there_is_a_bad_gateway() -> None:
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{reserved.getsockname()[1]}"
        async with (
            Network(even_profile("x", Impairment()), console_url=url, hosts=["127.0.0.1"]) as network,
            httpx.AsyncClient(base_url=network.console_url, trust_env=False) as browser,
        ):
            answer = await browser.get("/")
            assert answer.status_code == 502
            assert "does not answer" in answer.text


async def test_a_session_is_led_through_a_forwarder_that_ends_with_it() -> None:
    async with proxied() as (console, network, browser):
        answer = await browser.post("/whep?stamp=trailer", content=OFFER, headers=SDP)
        assert (answer.status_code, answer.headers["location"], answer.headers["etag"]) == (201, "/whep/1", '"e"')
        assert int(answer.headers["content-length"]) == len(answer.content)
        assert console.headers[0]["authorization"] == "Bearer t"
        method, path, offer = console.asked[0]
        assert (method, path) == ("POST", "/whep?stamp=trailer")
        assert "candidate" not in offer, "the console must not find a way around the forwarder"
        door = port_in(answer.text)
        assert door != 4000
        assert is_taken(door)
        assert network.statistics().clients == 1
        console.delete_status = 404
        await browser.delete("/whep/1")
        assert is_taken(door), "a refused request ends nothing"
        console.delete_status = 200
        await browser.delete("/whep/1")
        assert not is_taken(door)


async def test_two_clients_get_a_forwarder_each() -> None:
    async with proxied() as (_, network, browser):
        ports = {port_in((await browser.post("/whep", content=OFFER, headers=SDP)).text) for _ in range(2)}
        assert len(ports) == 2
        assert network.statistics().clients == 2


async def test_trickled_candidates_are_left_out_and_an_ice_restart_gets_new_ports() -> None:
    async with proxied() as (console, _, browser):
        first = port_in((await browser.post("/whep", content=OFFER, headers=SDP)).text)
        console.status, console.answer = 204, ""
        fragment = "a=ice-ufrag:cccc\r\nm=audio 9 X\r\na=mid:0\r\na=candidate:1 1 udp 1 192.0.2.9 4000 typ host\r\n"
        assert (await browser.patch("/whep/1", content=fragment, headers=FRAGMENT)).status_code == 204
        assert console.asked[-1][2] == "a=ice-ufrag:cccc\r\nm=audio 9 X\r\na=mid:0\r\n"
        console.status, console.answer = 200, ANSWER
        answer = await browser.patch("/whep/1", content=fragment, headers=FRAGMENT)
        assert port_in(answer.text) not in (first, 4000)
        assert is_taken(first)


async def test_a_refused_offer_leaves_no_forwarder_behind() -> None:
    async with proxied() as (console, network, browser):
        console.status, console.answer = 503, '{"error": "link_down"}'
        answer = await browser.post("/whep", content=OFFER, headers=SDP)
        assert (answer.status_code, answer.text) == (503, '{"error": "link_down"}')
        console.status, console.answer = 201, "v=0\r\n"
        answer = await browser.post("/whep", content=OFFER, headers=SDP)
        assert answer.status_code == 502
        assert "--ice-host" in answer.text
        assert len(network._sessions) == 0


async def test_a_redirect_stays_on_the_proxy() -> None:
    async with proxied() as (_, network, browser):
        location = (await browser.get("/moved")).headers["location"]
        assert location in ("/there", f"{network.console_url}/there")


async def test_a_request_and_its_answer_each_take_the_paths_time_and_wait_for_an_outage() -> None:
    async with proxied(even_profile("slow", Impairment(delay=Constant(0.02)))) as (_, network, browser):
        loop = asyncio.get_running_loop()
        began = loop.time()
        await browser.get("/")
        assert loop.time() - began > 0.039
        network.outage(0.2, hold=True)
        began = loop.time()
        await browser.get("/")
        assert loop.time() - began > 0.2


async def test_a_websocket_passes_both_ways_with_its_subprotocol_and_origin() -> None:
    async with proxied(even_profile("slow", Impairment(delay=Constant(0.005)))) as (_, network, _):
        url = network.console_url.replace("http", "ws") + "/echo?x=1"
        origin = network.console_url
        async with asyncio.timeout(20), connect(url, subprotocols=["viser-v1"], origin=origin, proxy=None) as browser:  # type: ignore[list-item,arg-type]
            assert browser.subprotocol == "viser-v1"
            assert await browser.recv() == origin
            await browser.send(b"\x00\x01")
            assert await browser.recv() == b"\x00\x01"
            await browser.send("text")
            assert await browser.recv() == "text"
            with pytest.raises(ConnectionClosed):
                await browser.recv()


async def test_a_websocket_that_the_console_refuses_is_refused() -> None:
    async with proxied() as (_, network, _):
        with pytest.raises(InvalidStatus):
            await connect(network.console_url.replace("http", "ws") + "/echo?no=1", proxy=None)


async def test_a_websocket_whose_browser_reads_nothing_is_closed_with_the_network(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = keep_websockets(monkeypatch, websocket_proxy)
    async with proxied() as (_, network, _):
        browser = await connect(network.console_url.replace("http", "ws") + "/flood", proxy=None)
        browser.transport.pause_reading()
        await eventually(lambda: bool(made) and not made[0].transport.is_reading())
    assert made[0].transport.is_closing()
    browser.transport.abort()
