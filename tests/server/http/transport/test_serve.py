"""The server runs beside a block, and either may fail."""

import asyncio
import datetime
import signal
import socket
import ssl
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

import pytest
from starlette.applications import Starlette

from lockstep.server.http.transport.acceptor import Acceptor
from lockstep.server.http.transport.serve import bind, running, stop_signals
from lockstep.server.http.transport.tls import Certificate, self_signed
from lockstep.server.http.transport.uvicorn_http_limits import BoundedConnections
from tests.waiting import PATIENCE


async def test_an_exception_of_the_block_comes_out_as_it_is() -> None:
    async def run() -> None:
        async with running(Starlette(), bind("127.0.0.1", 0)):
            raise KeyError

    async with asyncio.timeout(PATIENCE):
        with pytest.raises(KeyError):
            await run()


async def test_a_server_that_accepts_nobody_any_more_cancels_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fail(acceptor: Acceptor) -> None:
        raise ZeroDivisionError

    async def run() -> None:
        bounded = BoundedConnections(cast(Any, asyncio.Protocol), cast(Any, None), cast(Any, None))
        async with running(Starlette(), bind("127.0.0.1", 0), http=bounded):
            await asyncio.Event().wait()

    monkeypatch.setattr(Acceptor, "run", fail)
    async with asyncio.timeout(PATIENCE):
        with pytest.raises(ExceptionGroup) as raised:
            await run()
    assert [type(each) for each in raised.value.exceptions] == [ZeroDivisionError]


async def test_the_second_signal_to_stop_has_its_usual_effect() -> None:
    with stop_signals() as asked:
        signal.raise_signal(signal.SIGTERM)
        async with asyncio.timeout(PATIENCE):
            await asked.wait()
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


async def test_a_server_that_does_not_start_says_why() -> None:
    nothing = Certificate(chain=Path("nothing.pem"), key=Path("nothing.pem"))
    with bind("127.0.0.1", 0) as listener:
        async with asyncio.timeout(PATIENCE):
            with pytest.raises(FileNotFoundError):
                async with running(Starlette(), listener, tls=nothing):
                    pass


async def test_no_connection_outlives_the_server_whatever_its_client_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.http.transport.serve.SHUTDOWN_TIMEOUT", 0.1)
    certificate = self_signed(tmp_path, {"127.0.0.1"}, datetime.datetime.now(datetime.UTC))

    def asked(port: int) -> ssl.SSLSocket:
        """A client that has an answer, and reads nothing more."""
        context = ssl.create_default_context(cafile=certificate.chain)
        client = context.wrap_socket(socket.create_connection(("127.0.0.1", port)), server_hostname="127.0.0.1")
        client.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert client.recv(1)
        return client

    listener = bind("127.0.0.1", 0)
    async with running(Starlette(), listener, tls=certificate):
        client = await asyncio.to_thread(asked, listener.getsockname()[1])
    with client, socket.socket(fileno=client.detach()) as raw:
        raw.settimeout(PATIENCE)
        with suppress(ConnectionResetError):
            while raw.recv(4096):  # what was sent of the end of TLS
                pass
