"""The page starts and ends a recording, and shows to everyone that there is one."""

import asyncio
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from lockstep.server.recording.verify.verify_file import verify_file
from tests.support.stack import Stack

pytestmark = pytest.mark.browser


async def test_the_operator_records_and_the_observer_sees_it_and_cannot(
    own_stack: Stack, chromium: Browser, tmp_path: Path
) -> None:
    async with (
        open_console(chromium, own_stack.operator) as operator,
        open_console(chromium, own_stack.observer, pad=False) as observer,
    ):
        await operator.until_live()
        await observer.until_live()
        button, shown = operator.page.locator(".record"), observer.page.locator(".record")
        await expect(button).to_have_text("Record")
        await expect(shown).to_be_hidden()
        await button.click()
        await expect(button).to_contain_text("Rec 0:")
        await expect(shown).to_contain_text("Rec 0:")
        await expect(shown).to_be_disabled()
        async with operator.driving():
            await operator.until("s.event > 8", 60)
        await button.click()
        await expect(button).to_have_text("Record")
        await expect(shown).to_be_hidden()
    (path,) = (tmp_path / "state" / "recordings").glob("*.mcap")
    verdict = await asyncio.to_thread(verify_file, path)
    assert [name for name, check in verdict.checks.items() if not check.ok] == []
    assert verdict.events >= 5
