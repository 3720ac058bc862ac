"""The process with LiveKit's client: the real one against a real port, and small ones that misbehave."""

import asyncio
import socket
import sys
import time

import pytest

from server.relay import livekit_process
from server.relay.errors import RelayClientFailed, RelayRefused, RelaySilent, RelayUnreachable
from server.relay.livekit_process import MOST_WAITING, open_livekit
from server.relay.livekit_tokens import LiveKitKeys
from server.relay.livekit_wire import Ended, Feedback, Join, Joined, Picture, decode_order, encode_message
from tests.support.livekit_stand_in import KEY, SECRET, livekit_stand_in

JOIN = Join("ws://127.0.0.1:9", "a.b.c", [])


def _python(code: str) -> tuple[str, ...]:
    return (sys.executable, "-c", "import sys, time\n" + code)


def _token(secret: str = SECRET) -> str:
    return LiveKitKeys(KEY, secret).publisher_token("demo", "lockstep", time.time())


async def test_a_port_where_nobody_listens_is_unreachable_and_the_token_is_not_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    token = _token()
    async with open_livekit() as process:
        with pytest.raises(RelayUnreachable) as failure:
            await process.join(Join(f"ws://127.0.0.1:{port}", token, []))
    assert token not in str(failure.value)


async def test_a_token_of_another_secret_is_refused() -> None:
    async with livekit_stand_in() as server, open_livekit() as process:
        with pytest.raises(RelayRefused):
            await process.join(Join(server.url, _token(SECRET[::-1]), []))
        assert server.refused
        assert not server.claims


async def test_a_client_that_cannot_be_started_has_a_name() -> None:
    with pytest.raises(RelayClientFailed, match="cannot be started"):
        async with open_livekit(("/nowhere/at-all",)):
            pass


@pytest.mark.parametrize("code", ["", "sys.stdout.buffer.write(bytes(9))", "sys.stdout.buffer.write(b'\\xff' * 9)"])
async def test_a_client_that_ends_or_makes_no_sense_has_a_name(code: str) -> None:
    async with open_livekit(_python(code)) as process:
        with pytest.raises(RelayClientFailed, match="its client"):
            await process.join(JOIN)


async def test_a_client_that_says_nothing_is_silent_and_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(livekit_process, "JOIN_SECONDS", 0.05)
    monkeypatch.setattr(livekit_process, "CLOSE_SECONDS", 0.05)
    async with open_livekit(_python("time.sleep(60)")) as process:
        with pytest.raises(RelaySilent):
            await process.join(JOIN)


async def test_what_a_slow_client_does_not_take_is_bounded_and_the_newest_feedback_waits() -> None:
    """It reads nothing until it is killed."""
    async with open_livekit(_python("sys.stdin.buffer.read(1); time.sleep(60)")) as process:
        picture = Picture(0, True, 0.0, bytes(60_000))
        taken = 0
        while process.put(picture):
            taken += 1
            assert taken < 20, "a bound"
        for number in range(100):
            process.put_newest(str(number))
        assert process._input.transport.get_write_buffer_size() < MOST_WAITING + 2 * len(picture.data)
        assert process._waiting == "99"
        process._process.kill()
        await process.close()


async def test_feedback_that_had_to_wait_goes_when_there_is_room_and_only_the_newest() -> None:
    echo = "\n".join(
        [
            "from server.relay.livekit_wire import *",
            "got = []",
            "while not got or got[-1] != '99':",
            "    order = decode_order(read_message(sys.stdin.buffer))",
            "    if isinstance(order, Feedback): got.append(order.text)",
            "sys.stdout.buffer.write(encode_message(Ended('lost', ' '.join(got))))",
        ]
    )
    async with open_livekit(_python(echo)) as process:
        while process.put(Picture(0, True, 0.0, bytes(60_000))):
            pass
        for number in range(100):
            process.put_newest(str(number))
        async with asyncio.timeout(30):
            said = await process.hear()
        assert isinstance(said, Ended)
        heard = said.detail.split()
        assert heard[-1] == "99"
        assert len(heard) <= 3
        await process.close()


def test_orders_survive_the_wire() -> None:
    for order in (JOIN, Picture(1, False, 2.5, b"x"), Feedback("{}")):
        assert decode_order(encode_message(order)[4:]) == order
    assert encode_message(Joined())[:4] != b""
