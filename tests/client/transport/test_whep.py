import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from lockstep.client.console_url import parse_link
from lockstep.client.errors import ConnectFailed, SignallingRefused
from lockstep.client.transport.whep import Whep
from lockstep.protocol.messages import StopTaken


@asynccontextmanager
async def http_server(*answers: str) -> AsyncIterator[tuple[str, list[str]]]:
    """A server that gives these answers, one a connection, and the requests that it got."""
    requests: list[str] = []
    waiting = list(answers)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode()
        length = next((int(line[15:]) for line in head.lower().splitlines() if line.startswith("content-length:")), 0)
        requests.append(head + (await reader.readexactly(length)).decode())
        writer.write(waiting.pop(0).encode())
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server:
        port = server.sockets[0].getsockname()[1]
        yield f"http://127.0.0.1:{port}/#token=secret", requests


def answer(status: str, body: str = "", *headers: str) -> str:
    lines = [f"HTTP/1.1 {status}", f"Content-Length: {len(body)}", "Connection: close", *headers]
    return "\r\n".join(lines) + "\r\n\r\n" + body


async def test_an_offer_gets_its_answer_and_where_to_end_it() -> None:
    created = answer("201 Created", "v=0 answer", "Location: /whep/7")
    async with http_server(created, answer("200 OK")) as (link, requests), Whep(parse_link(link)) as whep:
        found = await whep.offer("v=0 offer", trailer=False)
        await whep.end(found.resource)
    assert found.sdp == "v=0 answer"
    assert requests[0].startswith("POST /whep HTTP/1.1")
    assert "authorization: bearer secret" in requests[0].lower()
    assert "content-type: application/sdp" in requests[0].lower()
    assert requests[0].endswith("v=0 offer")
    assert requests[1].startswith("DELETE /whep/7 HTTP/1.1")


async def test_who_wants_the_trailer_says_so() -> None:
    created = answer("201 Created", "v=0", "Location: /whep/7")
    async with http_server(created) as (link, requests), Whep(parse_link(link)) as whep:
        await whep.offer("v=0", trailer=True)
    assert requests[0].startswith("POST /whep?stamp=trailer ")


async def test_an_error_keeps_its_name_and_detail() -> None:
    refused = answer("503 Service Unavailable", '{"error": "robot_unreachable", "detail": "tcp://x"}')
    async with http_server(refused) as (link, _), Whep(parse_link(link)) as whep:
        with pytest.raises(SignallingRefused) as caught:
            await whep.offer("v=0", trailer=False)
    assert (caught.value.status, caught.value.error, caught.value.detail) == (503, "robot_unreachable", "tcp://x")


async def test_an_error_that_is_not_ours_is_reported_as_it_is() -> None:
    async with http_server(answer("502 Bad Gateway", "<html>")) as (link, _), Whep(parse_link(link)) as whep:
        with pytest.raises(SignallingRefused, match="502: <html>"):
            await whep.stop("", "p")


async def test_the_answer_to_a_stop_says_whether_it_is_on_the_robots_disk() -> None:
    taken = answer("200 OK", '{"delivered": true, "event": 1, "number": 7, "press": "p", "kept": false}')
    async with http_server(taken) as (link, _), Whep(parse_link(link)) as whep:
        assert await whep.stop("", "p") == StopTaken(press="p", number=7, kept=False)


@pytest.mark.parametrize(
    "wrong",
    [
        answer("200 OK", "hello"),
        answer("201 Created", "v=0"),
        answer("201 Created", "v=0", "Location: http://elsewhere.example/whep/1"),
    ],
)
async def test_what_is_not_whep_is_refused(wrong: str) -> None:
    async with http_server(wrong) as (link, _), Whep(parse_link(link)) as whep:
        with pytest.raises(SignallingRefused):
            await whep.offer("v=0", trailer=False)


async def test_nobody_there_is_said_so() -> None:
    server = await asyncio.start_server(lambda reader, writer: None, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    server.close()
    await server.wait_closed()
    async with Whep(parse_link(f"http://127.0.0.1:{port}/#token=t")) as whep:
        with pytest.raises(ConnectFailed, match="is the console running there"):
            await whep.offer("v=0", trailer=False)
