"""Runs a robot bridge in a separate process, beside the console: rendering of a robot never holds up a command."""

import asyncio
import os
import shutil
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from lockstep.robot_bridge.robots.other_python import link_packages, with_packages
from lockstep.robot_bridge.watchdog.liveness import EXIT_HUNG
from lockstep.server.util.backoff import Backoff

__all__ = ["BridgeFailed", "BridgeProcess"]

START_TIMEOUT = 60.0  # s; a physics engine and a GL context may have to be loaded
STOP_TIMEOUT = 5.0  # s to bring the robot to rest and go
MAX_LINE = 4096
NOT_FOUND = 127  # the shell's code for a program that cannot be run


class BridgeFailed(Exception):
    """The bridge could not be started; its own output says why."""

    def __init__(self, code: int | None) -> None:
        super().__init__(code)
        self.code = code

    def __str__(self) -> str:
        return "the robot bridge did not start in time" if self.code is None else f"the robot bridge ended: {self.code}"


class BridgeProcess:
    """`start` returns the bridge's address; then await `watch`, which restarts it when it dies. `close` ends it.

    It keeps the port of its first run, so that the robot link finds it again.
    """

    def __init__(
        self,
        robot: str,
        host: str,
        port: int,
        options: list[str],
        secret: str,
        say: Callable[[str], None],
        python: str | None = None,
    ) -> None:
        """`secret`: of the robot link; passed in an environment variable, which other users cannot read.

        `python`: another interpreter than the console's, such as that of a ROS installation. It finds the bridge's code
        here, but not the packages beside it: those are for another version of Python, and would hide its own.
        """
        self._robot = robot
        self._host = host
        self._port = port
        self._options = options
        self._python = python or sys.executable
        self._is_foreign = python is not None
        self._environment = {**os.environ, "LOCKSTEP_LINK_SECRET": secret}
        self._environment.pop("LOCKSTEP_ROBOT_CONFIG", None)  # for a bridge that runs by itself
        self._alone: TemporaryDirectory[str] | None = None  # while it runs: a folder with the bridge's package alone
        self._say = say
        self._process: asyncio.subprocess.Process | None = None
        self._backoff = Backoff(0.5, 10.0)

    async def start(self) -> str:
        """Start the bridge and return its address, "tcp://host:port".

        Raises:
            BridgeFailed: it ended, or said nothing in time.
        """
        command = [
            *(self._python, "-m", "lockstep.robot_bridge", self._robot, "--json"),
            *("--host", self._host, "--port", str(self._port), *self._options),
        ]
        environment = self._environment
        if self._is_foreign:
            environment = with_packages(environment, self._folder_of_the_bridge())
        if (setpriv := shutil.which("setpriv")) is not None:
            command = [setpriv, "--pdeathsig", "TERM", *command]  # also when the console is killed
        try:
            self._process = await asyncio.create_subprocess_exec(
                *command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                limit=MAX_LINE,
                start_new_session=True,
                env=environment,
            )
        except OSError as error:
            self._say(f"{error.filename}: {error.strerror}")
            await self.close()
            raise BridgeFailed(NOT_FOUND) from error
        try:
            address = await self._read_address(self._process)
        except BaseException:
            await self.close()
            raise
        self._port = int(address.rpartition(":")[2])
        return address

    async def watch(self) -> None:
        """Restart the bridge when it dies, until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            if self._process is not None:
                since = loop.time()
                code = await self._process.wait()
                self._say(f"the robot bridge ended ({_meaning(code)}); starting it again")
                if loop.time() - since > START_TIMEOUT:
                    self._backoff.healthy()
            await asyncio.sleep(self._backoff.next())
            try:
                self._say(f"the robot bridge runs again at {await self.start()}")
            except BridgeFailed as error:
                self._say(f"{error}; trying again")

    async def close(self) -> None:
        """End the bridge, gently first. Idempotent."""
        process, self._process = self._process, None
        if process is not None and process.returncode is None:
            await _end(process)
        if self._alone is not None:
            self._alone.cleanup()
            self._alone = None

    def _folder_of_the_bridge(self) -> str:
        if self._alone is None:
            self._alone = TemporaryDirectory(prefix="lockstep-bridge-")
            link_packages(Path(self._alone.name))
        return self._alone.name

    async def _read_address(self, process: asyncio.subprocess.Process) -> str:
        if process.stdout is None:
            raise BridgeFailed(None)
        try:
            async with asyncio.timeout(START_TIMEOUT):
                while True:
                    with suppress(ValueError):  # skips a line that is too long
                        line = await process.stdout.readline()
                        if not line:
                            raise BridgeFailed(await process.wait())
                        if (address := _address_in(line)) is not None:
                            return address
        except TimeoutError as error:
            raise BridgeFailed(None) from error


async def _end(process: asyncio.subprocess.Process) -> None:
    """End a process, gently first."""
    with suppress(ProcessLookupError):
        process.terminate()
    try:
        async with asyncio.timeout(STOP_TIMEOUT):
            await process.wait()
    except TimeoutError:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


class _Announcement(msgspec.Struct):
    robot: str


_announcement = msgspec.json.Decoder(_Announcement)


def _address_in(line: bytes) -> str | None:
    """Return the address in a line; None for other output, such as that of a robot's library."""
    try:
        return _announcement.decode(line).robot
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


def _meaning(code: int) -> str:
    if code == EXIT_HUNG:
        return "it hung: no control tick"
    return f"signal {-code}, {signal.strsignal(-code)}" if code < 0 else f"exit code {code}"
