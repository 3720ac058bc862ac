"""A real Caddy with our Caddyfile in front of a real console: TLS, the page, signalling, and what stays inside."""

from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.harness.caddy import running_caddy
from lockstep.bench.harness.free_port import free_port
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.browser


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
    async with running_caddy("Caddyfile", tmp_path, free_port(), LOCKSTEP_PORT=stack.console.rsplit(":", 1)[1]) as url:
        yield url


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
