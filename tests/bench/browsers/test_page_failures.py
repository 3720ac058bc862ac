"""A page that fails while it drives ends the block; one that was closed only ends the driving."""

import asyncio
from typing import cast

import pytest
from playwright.async_api import Error, Page

from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.experiment.browser_stick import BrowserStick
from tests.waiting import PATIENCE


class FakePage:
    """Meets every wait at once, until it is `broken`."""

    def __init__(self) -> None:
        self.broken = False
        self.closed = False
        self.asked = asyncio.Event()  # set when a broken page was asked

    async def evaluate(self, script: str, argument: object = None) -> None:
        if self.broken:
            self.asked.set()
            raise Error("planted")

    def locator(self, _: str) -> "FakePage":
        return self

    async def text_content(self) -> str:
        return ""

    def is_closed(self) -> bool:
        return self.closed


def fake() -> tuple[FakePage, ConsolePage]:
    page = FakePage()
    return page, ConsolePage(cast("Page", page))


async def drive(page: FakePage, console: ConsolePage) -> None:
    async with asyncio.timeout(PATIENCE), console.driving():
        page.broken = True
        await page.asked.wait()
        await asyncio.sleep(0)
        if not page.closed:
            await asyncio.Event().wait()


async def test_a_page_that_fails_while_it_drives_cancels_the_block() -> None:
    page, console = fake()
    with pytest.raises(ExceptionGroup) as raised:
        await drive(page, console)
    assert [repr(each) for each in raised.value.exceptions] == ["Error('planted')"]


async def test_a_page_that_is_closed_while_it_drives_leaves_the_block_alone() -> None:
    page, console = fake()
    page.closed = True
    await drive(page, console)


async def test_a_stick_whose_page_fails_says_so_and_one_whose_page_is_closed_ends() -> None:
    page, console = fake()
    page.broken = True
    with pytest.raises(Error, match="planted"):
        await BrowserStick(console).run()
    page.closed = True
    await BrowserStick(console).run()
