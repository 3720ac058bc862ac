"""The server runs beside a block, and either may fail."""

import asyncio
import signal
from pathlib import Path
from typing import Any, cast

import pytest
from starlette.applications import Starlette

from lockstep.server.http.transport.acceptor import Acceptor
from lockstep.server.http.transport.serve import bind, running, stop_signals
from lockstep.server.http.transport.tls import Certificate
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
