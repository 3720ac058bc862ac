"""Speaks to a process of Lockstep, which runs in another Python: LeRobot pins older packages than Lockstep needs.

A frame is the length of a JSON map (4 bytes, big-endian), the map, and the bytes whose lengths `sizes` lists.
"""

import json
import os
import select
import subprocess
import time
from contextlib import suppress
from typing import Any

from lerobot_robot_lockstep.errors import LockstepLost, error_of

__all__ = ["Pipe"]

MARGIN = 5.0  # s that an answer may take on top of what was asked for
LEAVE_SECONDS = 5.0  # for the robot to come to rest and the process to end
CHUNK = 1 << 18
MAX_MAP, MAX_BLOCK = 1 << 20, 64 << 20  # bytes of an answer's map, and of one picture behind it


class Pipe:
    """One process of Lockstep. One request at a time, from one thread.

    A request that has no whole answer is the last: its answer may still come, and would be taken for the next one's.
    """

    def __init__(self, python: str, module: str) -> None:
        """Start the process.

        Raises:
            LockstepLost: it cannot be started.
        """
        # Isolated: the paths of LeRobot's environment are for another Python's packages. The process ends with this
        # one, also if this one ends while it is starting.
        command = [python, "-I", "-m", module, str(os.getpid())]
        try:
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        except OSError as error:
            raise LockstepLost(f"{python} cannot be run: {error.strerror}") from error
        self._in_step = True

    @property
    def alive(self) -> bool:
        """Whether the process runs, and every request so far had its answer."""
        return self._in_step and self._process.poll() is None

    def ask(self, do: str, within: float = 0.0, **values: Any) -> tuple[dict[str, Any], list[bytearray]]:
        """Ask for something; return the answer and the bytes that follow it.

        Args:
            do: the request's name
            within: s that the answer takes at most, by what was asked for
            values: the request's fields

        Raises:
            LockstepError: the console or the robot said no.
            LockstepLost: the connection or the process ended, or the process does not answer.
        """
        if not self._in_step:
            raise LockstepLost("an earlier request had no answer")
        deadline = time.monotonic() + within + MARGIN
        text = json.dumps({"do": do, **values}).encode()
        stdin = self._process.stdin
        assert stdin is not None
        self._in_step = False  # also if Ctrl-C ends this call
        try:
            stdin.write(len(text).to_bytes(4, "big") + text)
        except (OSError, ValueError) as error:
            raise self._lost() from error
        try:
            answer, blocks = self._answer(deadline)
        except LockstepLost:
            self._hang_up()
            raise
        self._in_step = True
        if "error" in answer:
            raise error_of(answer)
        return answer, blocks

    def _answer(self, deadline: float) -> tuple[dict[str, Any], list[bytearray]]:
        """Read the answer's map and the bytes behind it."""
        size = int.from_bytes(self._read(4, deadline), "big")
        if size > MAX_MAP:
            raise LockstepLost(f"Lockstep's process announced an answer of {size} bytes")
        try:
            answer: dict[str, Any] = json.loads(self._read(size, deadline))
            sizes = [int(each) for each in answer.pop("sizes", [])]
        except (ValueError, TypeError, AttributeError) as error:
            raise LockstepLost("Lockstep's process said something else than an answer") from error
        if any(not 0 <= each <= MAX_BLOCK for each in sizes):
            raise LockstepLost(f"Lockstep's process announced a picture of {max(sizes)} bytes")
        return answer, [self._read(each, deadline) for each in sizes]

    def close(self) -> None:
        """End the process in order: it brings the robot to rest and gives the seat back. May be called again."""
        process = self._process
        self._hang_up()
        try:
            process.wait(LEAVE_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _hang_up(self) -> None:
        """Let the process end in its own time: nobody may be left to call `close`."""
        self._in_step = False
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with suppress(OSError):
                    stream.close()

    def _read(self, size: int, deadline: float) -> bytearray:
        """Read exactly this many bytes."""
        stdout = self._process.stdout
        assert stdout is not None
        found, view_at = bytearray(size), 0
        while view_at < size:
            ready, _, _ = select.select([stdout], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                raise LockstepLost("Lockstep's process does not answer")
            with memoryview(found) as view:
                count = stdout.readinto(view[view_at : view_at + CHUNK])  # type: ignore[attr-defined]
            if not count:
                raise self._lost()
            view_at += count
        return found

    def _lost(self) -> LockstepLost:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        return LockstepLost(f"Lockstep's process has ended ({self._process.returncode}); its own words are above")
