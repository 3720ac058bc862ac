"""Firefox for a test or a measurement, through WebDriver BiDi (puppeteer-core in a separate Node process)."""

import asyncio
import json
import shutil
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

__all__ = ["Firefox", "running_firefox"]

DRIVER = Path(__file__).with_name("firefox_driver.mjs")
END_SECONDS = 20.0
ANSWER_LIMIT = 16 << 20  # bytes in one answer line


class Firefox:
    """One page in one Firefox."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process

    async def prepare(self, script: str) -> None:
        """Run `script` in every document from now on, before anything of the document's own."""
        await self._ask("prepare", script=script)

    async def open(self, url: str) -> None:
        await self._ask("open", url=url)

    async def evaluate(self, expression: str) -> Any:
        return await self._ask("evaluate", expression=expression)

    async def wait(self, expression: str, seconds: float = 20.0) -> None:
        """Wait until `expression` is true in the page.

        Raises:
            RuntimeError: it does not come true in time.
        """
        await self._ask("wait", expression=expression, timeout=seconds * 1000)

    async def key(self, code: str, *, down: bool) -> None:
        await self._ask("key", code=code, down=down)

    async def click(self, selector: str) -> None:
        await self._ask("click", selector=selector)

    async def screenshot(self, path: Path) -> None:
        await self._ask("screenshot", path=str(path))

    async def errors(self) -> list[str]:
        """Return the uncaught errors of the page so far."""
        found: list[str] = await self._ask("errors")
        return found

    async def _ask(self, verb: str, **arguments: object) -> Any:
        if self._process.stdin is None:
            raise RuntimeError("the driver has no pipes")
        self._process.stdin.write(json.dumps({"verb": verb, **arguments}).encode() + b"\n")
        await self._process.stdin.drain()
        return await self.answer(verb)

    async def answer(self, verb: str) -> Any:
        """Return the next answer of the driver, which is of `verb`. Raises RuntimeError: it failed, or has ended."""
        if self._process.stdout is None:
            raise RuntimeError("the driver has no pipes")
        line = await self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"the Firefox driver ended ({verb})")
        answer = json.loads(line)
        if "error" in answer:
            raise RuntimeError(f"{verb}: {answer['error']}")
        return answer["value"]


@asynccontextmanager
async def running_firefox(environment: dict[str, str] | None = None) -> AsyncIterator[Firefox]:
    """Start a headless Firefox with one empty page and its own profile; close it on leaving.

    Raises:
        RuntimeError: Firefox is not installed, or does not begin.
    """
    executable = shutil.which("firefox-esr") or shutil.which("firefox")
    if executable is None:
        raise RuntimeError("Firefox is not installed: make test installs Debian's firefox-esr")
    process = await asyncio.create_subprocess_exec(
        *("node", str(DRIVER), executable),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        limit=ANSWER_LIMIT,
        env=environment,
    )
    try:
        browser = Firefox(process)
        await browser.answer("begin")
        yield browser
    finally:
        if process.stdin is not None:
            process.stdin.close()
        await _end(process)


async def _end(process: asyncio.subprocess.Process) -> None:
    """Wait for the driver's end; it ends Firefox too where it is told to terminate."""
    for number in (None, signal.SIGTERM, signal.SIGKILL):
        if number is not None:
            process.send_signal(number)
        with suppress(TimeoutError):
            async with asyncio.timeout(END_SECONDS):
                await process.wait()
            return
