"""Chromium for a test, through Playwright; always the system's own browser with a new profile."""

import asyncio
import shutil
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from playwright.async_api import Browser, BrowserContext, Page, async_playwright

__all__ = ["PAD", "chromium_program", "missed_in_page", "open_page", "running_chromium"]

PAD = Path(__file__).with_name("test_pad.js")
# The switch replaces Playwright's own, whose list these are, but for the last three. With WebUIOmnibox… every window
# loads two pages for suggestions below an unseen address bar, which costs more than the tested page;
# with SpareRenderer… it starts a process for a page that is never opened.
DISABLED_FEATURES = (
    "AvoidUnnecessaryBeforeUnloadCheckSync",
    "DestroyProfileOnBrowserClose",
    "HttpsUpgrades",
    "HttpsFirstBalancedModeAutoEnable",
    "LensOverlay",
    "MediaRouter",
    "PaintHolding",
    "ThirdPartyStoragePartitioning",
    "AvoidCorsURLLoaderRestartOnRedirect",
    "OptimizationHints",
    "NetworkTimeServiceQuerying",
    "AimEnabled",
    "PreconnectToSearch",
    "WebUIOmniboxPopup",
    "WebUIOmniboxAimPopup",
    "SpareRendererForSitePerProcess",
)
FLAGS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--autoplay-policy=no-user-gesture-required",
    f"--disable-features={','.join(DISABLED_FEATURES)}",
]


ASKED_SECONDS = 5.0  # in the page, for one answer
ANSWER_SECONDS = 15.0  # for the answer to come


def chromium_program() -> Path:
    found = shutil.which("chromium") or shutil.which("google-chrome")
    if found is None:
        raise RuntimeError("Chromium is not installed: make test installs Debian's chromium")
    return Path(found)


@asynccontextmanager
async def running_chromium(
    environment: dict[str, str] | None = None, flags: Sequence[str] = (), *, executable: Path | None = None
) -> AsyncIterator[Browser]:
    """Start a headless Chromium; close it on leaving. It makes sound, which Playwright would otherwise mute.

    `executable`: a program that runs it, such as one that first enters a network namespace; None: Chromium itself.
    """
    executable = executable or chromium_program()
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=executable,
            args=[*FLAGS, *flags],
            ignore_default_args=["--mute-audio"],
            env=dict(environment) if environment else None,
        )
        try:
            yield browser
        finally:
            await browser.close()


@asynccontextmanager
async def open_page(
    browser: Browser,
    link: str,
    *,
    width: int = 1280,
    height: int = 800,
    pad: bool = False,
    touch: bool = False,
    scripts: Sequence[Path] = (),
) -> AsyncIterator[Page]:
    """Open `link` in a page with its own context; uncaught errors of the page fail the test on leaving.

    `scripts` run in the page before its own.
    """
    context: BrowserContext = await browser.new_context(viewport={"width": width, "height": height}, has_touch=touch)
    try:
        if pad:
            await context.add_init_script(path=PAD)
        for script in scripts:
            await context.add_init_script(path=script)
        page = await context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        await page.goto(link)
        yield page
        if errors:
            raise AssertionError("the page threw: " + "; ".join(errors))
    finally:
        await context.close()


async def missed_in_page(page: Page, script: str, seconds: float) -> str | None:
    """Wait with `script`, a function of milliseconds; return its last value, or None once its wait is over.

    It is asked again every few seconds: an answer is lost if the page turns to another document meanwhile.
    """
    end = time.monotonic() + seconds
    while True:
        wait = max(0.0, min(ASKED_SECONDS, end - time.monotonic()))
        missed: str | None = "the page does not answer"
        with suppress(TimeoutError):
            async with asyncio.timeout(ANSWER_SECONDS):
                missed = await page.evaluate(script, wait * 1000)
        if missed is None or time.monotonic() >= end:
            return missed
