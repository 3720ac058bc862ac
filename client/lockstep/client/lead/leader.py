"""A leader arm in LeRobot's Python, whose newest action is kept here."""

import asyncio
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

__all__ = ["Leader", "LeaderFailed", "Newest"]

START_SECONDS = 60.0  # PyTorch takes its time
END_SECONDS = 5.0
OLD = 0.25  # s after which an action is not where the leader is

_decoder = msgspec.json.Decoder(dict[str, Any])


class LeaderFailed(Exception):
    """The leader cannot be used, or has gone; the text says why."""


class Newest:
    """The newest action, while it is recent. No I/O, no clock."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._action: Mapping[str, float] = {}
        self._time = float("-inf")

    def put(self, action: Mapping[str, float], now: float) -> None:
        self._action, self._time = action, now

    def readings(self, now: float) -> list[float | None]:
        """Return a reading for each name; None for each that is missing or old."""
        if now - self._time > OLD:
            return [None] * len(self._names)
        return [self._action.get(name) for name in self._names]


class Leader:
    """The process that reads the leader. Use it as an async context manager.

    Attributes:
        names: the entries of its action
    """

    def __init__(self, python: str, flags: Sequence[str], rate: float) -> None:
        """`flags`: LeRobot's own, --teleop.type=… and so on. `rate`: Hz."""
        script = Path(__file__).with_name("leader_side.py")
        self._command = [python, str(script), f"--rate={rate:g}", *flags]
        self._process: asyncio.subprocess.Process | None = None
        self.names: list[str] = []

    async def __aenter__(self) -> "Leader":
        """Start the leader.

        Raises:
            LeaderFailed: it cannot be used.
        """
        pipe = asyncio.subprocess.PIPE
        try:
            self._process = await asyncio.create_subprocess_exec(*self._command, stdin=pipe, stdout=pipe)
        except OSError as error:
            raise LeaderFailed(f"{self._command[0]} cannot be run: {error.strerror}") from error
        try:
            async with asyncio.timeout(START_SECONDS):
                self.names = list((await self._line())["ready"])
        except TimeoutError as error:
            await self._end()
            raise LeaderFailed("the leader did not answer in time") from error
        except BaseException:
            await self._end()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._end()

    async def read_into(self, newest: Newest) -> None:
        """Keep the newest action until cancelled.

        Raises:
            LeaderFailed: the leader has gone.
        """
        clock = asyncio.get_running_loop().time
        while True:
            said = await self._line()
            newest.put(said.get("action", {}), clock())

    async def _line(self) -> dict[str, Any]:
        process = self._process
        if process is None or process.stdout is None:
            raise LeaderFailed("the leader is not there")
        line = await process.stdout.readline()
        if not line:
            raise LeaderFailed(f"the leader's process has ended ({await process.wait()})")
        try:
            said = _decoder.decode(line)
        except msgspec.DecodeError as error:
            raise LeaderFailed("the leader's process said something else than actions") from error
        if "error" in said:
            raise LeaderFailed(str(said["error"]))
        return said

    async def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        try:
            async with asyncio.timeout(END_SECONDS):
                await process.wait()
        except TimeoutError:
            print("lockstep drive: the leader's process does not end; it is killed", file=sys.stderr)  # noqa: T201
            process.kill()
            await process.wait()
