"""The page from another machine: only an encrypted console gives it a gamepad."""

import asyncio
from pathlib import Path

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import PAD
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.browsers.pad import RB
from lockstep.rtc.interfaces import own_addresses
from tests.support.stack import running_stack
from tests.waiting import PATIENCE

pytestmark = pytest.mark.browser


def _outer_address() -> str:
    """An address of this machine that browsers do not trust as they trust loopback."""
    found = [address for address in own_addresses() if ":" not in address]
    if not found:
        pytest.skip("this machine has no address but loopback")
    return found[0]


async def test_a_self_signed_console_can_be_driven_with_a_pad_and_shows_the_3d_scene(
    tmp_path: Path, chromium: Browser
) -> None:
    address = _outer_address()
    extra = ("--host", address, "--tls", "self-signed")
    async with running_stack(tmp_path, extra=extra) as stack:
        assert stack.operator.startswith(f"https://{address}:")
        await stack.says("SHA-256 fingerprint")
        context = await chromium.new_context(ignore_https_errors=True)
        try:
            await context.add_init_script(path=PAD)
            tab = await context.new_page()
            await tab.goto(stack.operator)
            page = ConsolePage(tab)
            await page.until_live()
            assert await tab.evaluate("window.isSecureContext")
            await page.arm()
            await page.drive_forward()
            await page.pad.press(RB, False)
            await page.until("s.at_rest")
            token = stack.operator.partition("#token=")[2]
            path = await tab.evaluate(
                "async (token) => (await (await fetch('/api/scene', {method: 'POST',"
                " headers: {Authorization: `Bearer ${token}`}})).json()).path",
                token,
            )
            assert f"websocket=wss://{address}" in path
            heard = asyncio.Event()  # it may have sent all that it has before the page is loaded
            tab.on("websocket", lambda socket: socket.on("framereceived", lambda _: heard.set()))
            async with tab.expect_websocket() as opening:
                await tab.goto(f"{stack.console}{path}")
            assert (await opening.value).url.startswith(f"wss://{address}")
            async with asyncio.timeout(PATIENCE):
                await heard.wait()
        finally:
            await context.close()


async def test_in_clear_a_page_from_elsewhere_has_no_secure_context(tmp_path: Path, chromium: Browser) -> None:
    address = _outer_address()
    async with running_stack(tmp_path, extra=("--host", address)) as stack:
        context = await chromium.new_context()
        try:
            tab = await context.new_page()
            await tab.goto(stack.console)
            assert not await tab.evaluate("window.isSecureContext"), "so the test above proves something"
        finally:
            await context.close()
