"""The console's end of the process that reads recordings: starts it, asks it one job at a time, ends it."""

import asyncio
import sys
from collections.abc import Callable
from contextlib import suppress

import msgspec

from lockstep.server.errors import (
    ConsoleError,
    NotAllowed,
    NotFound,
    RecordingFailed,
    RecordingUnreadable,
    ShuttingDown,
    TooManyRequests,
)
from lockstep.server.recording.browsing.jobs import ANSWER, MAX_ANSWER, STATUSES, Job, JobStatus

__all__ = ["COMMAND", "RecordingWorker"]

COMMAND = (sys.executable, "-m", "lockstep.server.recording.browsing.worker_process")
MAX_WAITING = 48  # jobs; further ones are refused
IDLE_SECONDS = 60.0  # then the process ends
REST_SHARE = 2.0  # of a job's time, for which the process rests after it while somebody drives
LEAST_REST, MOST_REST = 0.1, 0.5  # s
START_SECONDS = 20.0  # a process may need on a busy machine, besides the time of its first job


class RecordingWorker:
    """Call `ask` on the loop, as often as wanted: jobs wait for each other. `close` it."""

    def __init__(
        self,
        command: tuple[str, ...] = COMMAND,
        max_waiting: int = MAX_WAITING,
        is_driven: Callable[[], bool] = lambda: False,
    ) -> None:
        """`is_driven`: whether somebody drives; then the process rests after each job."""
        self._command = command
        self._is_driven = is_driven
        self._free_at = 0.0  # s, of the loop: when it may do the next job
        self._max_waiting = max_waiting
        self._turn = asyncio.Lock()
        self._waiting = 0
        self._process: asyncio.subprocess.Process | None = None
        self._ended: list[asyncio.subprocess.Process] = []  # that were killed, and are not reaped yet
        self._idle: asyncio.TimerHandle | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        """The process; None while there is none."""
        return None if self._process is None else self._process.pid

    async def ask(self, job: Job, seconds: float) -> bytes:
        """Return the answer; after `seconds` the process is ended, and another one does the next job.

        Raises:
            TooManyRequests: too many jobs wait.
            RecordingFailed: it cannot be done now: it took too long, its process ended, or the disk fails.
            NotFound, NotAllowed, RecordingUnreadable: it cannot be done.
        """
        if self._waiting >= self._max_waiting:
            raise TooManyRequests("too much of recordings is asked for at once")
        self._waiting += 1
        try:
            async with self._turn:
                loop = asyncio.get_running_loop()
                if (rest := self._free_at - loop.time()) > 0:
                    await asyncio.sleep(rest)
                began = loop.time()
                status, body = await self._do(job, seconds)
                if self._is_driven():
                    took = loop.time() - began
                    self._free_at = loop.time() + min(max(LEAST_REST, REST_SHARE * took), MOST_REST)
        finally:
            self._waiting -= 1
        if status == "done":
            return body
        raise _error(status, body.decode(errors="replace"))

    async def close(self) -> None:
        """End the process. Idempotent."""
        self._closed = True
        self._end()
        await self._reap()

    async def _do(self, job: Job, seconds: float) -> tuple[JobStatus, bytes]:
        if self._idle is not None:
            self._idle.cancel()
        await self._reap()
        try:
            async with asyncio.timeout(seconds + (START_SECONDS if self._process is None else 0.0)):
                return await self._answer(await self._running(), job)
        except TimeoutError:
            self._end()
            return "unreadable", b"reading it takes too long"
        except (OSError, EOFError):  # it crashed, or was killed
            self._end()
            return "unreadable", b"the process that reads it has failed"
        except BaseException:  # an answer that nobody awaits would be taken for that of the next job
            self._end()
            raise
        finally:
            if self._process is not None:
                self._idle = asyncio.get_running_loop().call_later(IDLE_SECONDS, self._end)

    async def _running(self) -> asyncio.subprocess.Process:
        if self._closed:
            raise ShuttingDown("the session of this robot ends")
        if self._process is None:
            self._process = await asyncio.create_subprocess_exec(
                *self._command,
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.DEVNULL,
            )
        return self._process

    async def _answer(self, process: asyncio.subprocess.Process, job: Job) -> tuple[JobStatus, bytes]:
        if process.stdin is None or process.stdout is None:
            raise EOFError
        process.stdin.write(msgspec.json.encode(job) + b"\n")
        await process.stdin.drain()
        number, length = ANSWER.unpack(await process.stdout.readexactly(ANSWER.size))
        if length > MAX_ANSWER or number >= len(STATUSES):
            self._end()
            return "damaged", b"the answer is too long"
        return STATUSES[number], await process.stdout.readexactly(length)

    def _end(self) -> None:
        if self._idle is not None:
            self._idle.cancel()
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):
                process.kill()
            self._ended.append(process)

    async def _reap(self) -> None:
        for process in self._ended:
            await process.wait()
        self._ended = [each for each in self._ended if each.returncode is None]


def _error(status: JobStatus, detail: str) -> ConsoleError:
    match status:
        case "deleted":
            return NotFound("it was deleted")
        case "nothing":
            return NotFound("there is no picture of this camera at this event")
        case "not_allowed":
            return NotAllowed(detail)
        case "unreadable":
            return RecordingFailed(f"it cannot be read: {detail}")
        case _:
            return RecordingUnreadable(detail)
