"""Follows a tutorial as its reader does: types its commands into bash, saves its programs, compares what is printed.

Each block of commands has to be used once, in the order of the page. Ports are replaced by free ones everywhere, and
the folder in which the commands run has what they need of a checkout.
"""

import asyncio
import os
import re
import shutil
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from lockstep.bench.harness.free_port import free_port

__all__ = ["ROOT", "Reader", "page"]

ROOT = Path(__file__).resolve().parents[3]
BLOCK = re.compile(r"^```(\w*)\n(.*?)\n```$", re.MULTILINE | re.DOTALL)
PROGRAM = re.compile(r"(?i)save this as `([\w.]+)`:\n\n```python\n(.*?)\n```", re.DOTALL)
VARIABLE = re.compile(r"[0-9a-f]{16,}|\d{8}T\d{6}Z-\w+|[\d.]+ ?(?:ms|MB|[smhd])?|eyJ[\w.…-]+| +")
PORTS = ("5600", "8000", "8080", "8443", "9090", "3478")
LINKED = (".venv", "docs")  # of the checkout, as they are
SECONDS = 90.0
READY_SECONDS = 40.0
TRIES = 5


class _Block(NamedTuple):
    language: str
    text: str


def page(name: str) -> str:
    return (ROOT / "docs" / "tutorials" / f"{name}.md").read_text()


def _shape(line: str) -> str:
    """The line without what differs from run to run."""
    return VARIABLE.sub("#", line.strip())


def _end(process: asyncio.subprocess.Process) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)


class Reader:
    """One who reads a page from its beginning, in a folder of their own.

    Args:
        name: the page's
        folder: empty; commands run there
        environment: beside that of the test
    """

    def __init__(self, name: str, folder: Path, **environment: str) -> None:
        text = page(name)
        self._blocks = [_Block(*found) for found in BLOCK.findall(text) if found[0] in ("sh", "text")]
        self._ports = {port: str(free_port()) for port in PORTS}
        self._environment = os.environ | {
            "PATH": f"{ROOT / '.venv' / 'bin'}:{os.environ['PATH']}",
            "LOCKSTEP_STATE_DIR": str(folder / "state"),
            "XDG_STATE_HOME": str(folder / "state-home"),
            "HOME": str(folder),
            **environment,
        }
        self.folder = folder
        self.values: dict[str, str] = {}  # put in the place of these patterns
        for each in LINKED:
            (folder / each).symlink_to(ROOT / each)
        shutil.copytree(ROOT / "deploy", folder / "deploy")
        for path in (path for path in (folder / "deploy").rglob("*") if path.is_file()):
            path.write_text(self._replaced(path.read_text()))
        for file, code in PROGRAM.findall(text):
            (folder / file).write_text(code + "\n")

    def port(self, written: str) -> str:
        """The one that stands for a port of the page."""
        return self._ports[written]

    @property
    def left(self) -> list[str]:
        """The blocks of commands that were not used."""
        return [block.text for block in self._blocks if block.language == "sh"]

    def take(self, beginning: str) -> str:
        """Return the next block of commands, which has to begin so. A test says with it why it does not run them."""
        while self._blocks and self._blocks[0].language == "text":
            del self._blocks[0]
        assert self._blocks[0].text.startswith(beginning), self._blocks[0].text
        return self._replaced(self._blocks.pop(0).text)

    async def run(self, beginning: str) -> str:
        """Run the next block to its end; return what it prints."""
        return await self.type(self.take(beginning))

    async def type(self, commands: str) -> str:
        """Run commands that are no block of their own. `lockstep check` finds nobody to ask here, so it gets --yes.

        A busy machine holds a robot up, which then wants a neutral command: as its reader would, try again.
        """
        commands = commands.replace("lockstep check ", "lockstep check --yes ")
        for _ in range(TRIES):
            async with self._bash(commands) as process, asyncio.timeout(SECONDS):
                said = (await process.communicate())[0].decode()
            if process.returncode == 0 or "not_neutral: " not in said:
                break
        assert process.returncode == 0, f"{commands}\n{said}"
        return said

    @asynccontextmanager
    async def running(self, beginning: str, until: str) -> AsyncIterator[str]:
        """Start the next block, which does not end, wait until it prints a line with `until`, and end it at last."""
        async with self.process(self.take(beginning), until) as said:
            yield said

    @asynccontextmanager
    async def process(self, commands: str, until: str) -> AsyncIterator[str]:
        """The same for commands that are no block of their own."""
        said = ""
        async with self._bash(commands) as process:
            assert process.stdout is not None
            async with asyncio.timeout(READY_SECONDS):
                while until not in said:
                    line = await process.stdout.readline()
                    assert line, f"{commands}\nended:\n{said}"
                    said += line.decode()
            drain = asyncio.create_task(process.stdout.read())
            try:
                yield said
            finally:
                _end(process)
                await drain

    @asynccontextmanager
    async def _bash(self, commands: str) -> AsyncIterator[asyncio.subprocess.Process]:
        process = await asyncio.create_subprocess_exec(
            *("bash", "-euo", "pipefail", "-c", commands),
            cwd=self.folder,
            env=self._environment,
            stdin=asyncio.subprocess.PIPE,  # `lockstep network` ends with its standard input
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            _end(process)
            await process.wait()

    def compare(self, said: str) -> None:
        """The page's next output has no line whose shape was not printed; lines with an ellipsis are cut there."""
        block = self._blocks.pop(0)
        assert block.language == "text", block.text
        printed = [_shape(line) for line in said.splitlines()]
        for line in (self._replaced(line) for line in block.text.splitlines() if line.strip("… ")):
            wanted = _shape(line.partition("…")[0])
            assert any(each == wanted or ("…" in line and each.startswith(wanted)) for each in printed), (line, said)

    def _replaced(self, text: str) -> str:
        text = re.sub(rf"\b({'|'.join(PORTS)})\b", lambda found: self._ports[found[0]], text)
        for pattern, value in self.values.items():
            text = re.sub(pattern, lambda _, value=value: value, text)  # type: ignore[misc]
        return text
