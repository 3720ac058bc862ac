"""A real Caddy with our Caddyfile in front of a real console: TLS, the page, signalling, and what stays inside."""

import asyncio
import os
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.harness.free_port import free_port
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.browser

CADDYFILE = Path(__file__).resolve().parents[2] / "deploy" / "Caddyfile"
READY_SECONDS = 20.0


@pytest.fixture
async def stack(tmp_path: Path) -> AsyncIterator[Stack]:
    async with running_stack(tmp_path) as running:
        yield running


@pytest.fixture
async def chromium() -> AsyncIterator[Browser]:
    async with running_chromium() as browser:
        yield browser


@pytest.fixture
async def site(stack: Stack, tmp_path: Path) -> AsyncIterator[str]:
    """Caddy's address, as people type it."""
    https, port = free_port(), stack.console.rsplit(":", 1)[1]
    settings = {"LOCKSTEP_SITE": "localhost", "LOCKSTEP_PORT": port}
    ports = {"LOCKSTEP_HTTPS_PORT": str(https), "LOCKSTEP_HTTP_PORT": str(free_port())}
    folders = {"HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path)}
    process = await asyncio.create_subprocess_exec(
        *("caddy", "run", "--config", str(CADDYFILE), "--adapter", "caddyfile"),
        env=os.environ | settings | ports | folders,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        url = f"https://localhost:{https}"
        async with asyncio.timeout(READY_SECONDS):
            await _until_it_answers(url)
        yield url
    finally:
        process.terminate()
        await process.wait()


async def _until_it_answers(url: str) -> None:
    async with _http(url) as http:
        while True:
            try:
                await http.get("/healthz")
            except httpx.TransportError:
                await asyncio.sleep(0.05)
            else:
                return


def _http(url: str) -> httpx.AsyncClient:
    return httpx.AsyncClient(base_url=url, verify=False, trust_env=False)


async def test_the_page_connects_and_shows_pictures_through_the_proxy(
    stack: Stack, site: str, chromium: Browser
) -> None:
    context = await chromium.new_context(ignore_https_errors=True)
    page = await context.new_page()
    await page.goto(stack.operator.replace(stack.console, site))
    console = ConsolePage(page)
    await console.until_live()
    await console.until("s.seat && s.seat.mine")
    assert await page.evaluate("window.isSecureContext")
    await context.close()


async def test_measurements_are_not_shown_to_the_internet(stack: Stack, site: str) -> None:
    async with _http(site) as outside, httpx.AsyncClient(base_url=stack.console, trust_env=False) as inside:
        assert (await outside.get("/metrics")).status_code == 404
        assert (await outside.get("/metrics/")).status_code == 404
        assert (await inside.get("/metrics")).status_code == 200
        assert (await outside.get("/healthz")).status_code == 200


async def test_the_consoles_own_headers_arrive(stack: Stack, site: str) -> None:
    async with _http(site) as http:
        answer = await http.get("/")
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
    assert answer.headers["referrer-policy"] == "no-referrer"
