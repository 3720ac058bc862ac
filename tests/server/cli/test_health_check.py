import asyncio

import pytest
from fastapi import FastAPI, Response

from lockstep.server.cli.health_check import health_url, main
from lockstep.server.http.transport.serve import bind, running
from lockstep.server.settings import Settings


async def _asked(status: int, monkeypatch: pytest.MonkeyPatch) -> int:
    app = FastAPI()
    app.add_api_route("/healthz", lambda: Response(status_code=status))
    listener = bind("127.0.0.1", 0)
    monkeypatch.setenv("LOCKSTEP_PORT", str(listener.getsockname()[1]))
    try:
        async with running(app, listener):
            return await asyncio.to_thread(main)
    finally:
        listener.close()


async def test_a_console_that_is_well_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert await _asked(200, monkeypatch) == 0


async def test_a_console_that_says_it_is_not_well_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    assert await _asked(503, monkeypatch) == 1


def test_a_console_that_does_not_answer_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    listener = bind("127.0.0.1", 0)
    monkeypatch.setenv("LOCKSTEP_PORT", str(listener.getsockname()[1]))
    listener.close()
    assert main() == 1
    assert "refused" in capsys.readouterr().err


def test_it_asks_on_loopback_and_over_tls_when_the_console_does() -> None:
    assert health_url(Settings(host="0.0.0.0", port=9000)) == "http://127.0.0.1:9000/healthz"
    assert health_url(Settings(host="::1", port=9000)) == "http://[::1]:9000/healthz"
    assert health_url(Settings(port=9000, tls="self-signed")) == "https://127.0.0.1:9000/healthz"
