"""A `Network` in a separate process: other work of this process then adds no delay to its packets.

Requests and answers are pickled over the pipes of a child that only this process talks to.
"""

import asyncio
import pickle
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import IO, Any, Self
from urllib.parse import urlsplit

import uvloop

from lockstep.emulator.impairment.deliveries import prefer_this_process
from lockstep.emulator.impairment.profile import Profile, load_profile
from lockstep.emulator.network import Network
from lockstep.emulator.network_statistics import NetworkStatistics
from lockstep.emulator.transport.udp_forwarder import LOOPBACK

__all__ = ["NetworkProcess", "serve"]

START = "from lockstep.emulator.namespace.network_process import serve; serve()"
STOP_SECONDS = 10.0
OWN_METHODS = frozenset({"open_console", "outage", "begin", "cut_robot", "statistics"})


class NetworkProcess:
    """Has the arguments and methods of `Network`, which documents them, but no `open_forwarder`.

    As root on Linux its process runs before others, so that a busy machine does not disturb it.
    """

    def __init__(
        self,
        profile: Profile | str,
        *,
        console_url: str | None = None,
        robot: tuple[str, int] | None = None,
        seed: int = 1,
        hosts: Sequence[str] | None = None,
        host: str = LOOPBACK,
        port: int = 0,
    ) -> None:
        self.profile = load_profile(profile) if isinstance(profile, str) else profile
        self.console_url = ""
        self.robot_address = ""
        self._arguments: dict[str, Any] = {"console_url": console_url, "robot": robot, "seed": seed}
        self._arguments |= {"hosts": hosts, "host": host, "port": port}
        self._process: subprocess.Popen[bytes] | None = None

    async def __aenter__(self) -> Self:
        try:
            await asyncio.to_thread(self._start)
        except BaseException:
            await asyncio.to_thread(self._end)
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await asyncio.to_thread(self._end)

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", START], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
        self._ask("enter", self.profile, **self._arguments)

    async def open_console(self, url: str) -> str:
        await asyncio.to_thread(self._ask, "open_console", url)
        return self.console_url

    def link(self, link: str) -> str:
        return urlsplit(link)._replace(scheme="http", netloc=urlsplit(self.console_url).netloc).geturl()

    def begin(self) -> None:
        self._ask("begin")

    def outage(self, seconds: float, *, hold: bool = False, robot: bool = False) -> None:
        self._ask("outage", seconds, hold=hold, robot=robot)

    def cut_robot(self) -> None:
        self._ask("cut_robot")

    def statistics(self) -> NetworkStatistics:
        found: NetworkStatistics = self._ask("statistics")
        return found

    def _ask(self, method: str, *arguments: Any, **named: Any) -> Any:
        """Ask the process and wait for the answer: about a millisecond, except for `enter` and `open_console`."""
        if self._process is None or self._process.stdin is None or self._process.stdout is None:
            raise RuntimeError("enter the network first")
        try:
            _write(self._process.stdin, (method, arguments, named))
            self.console_url, self.robot_address, result = pickle.load(self._process.stdout)
        except (OSError, EOFError, ValueError) as error:
            raise RuntimeError("the network's process has ended") from error
        if isinstance(result, BaseException):
            raise result
        return result

    def _end(self) -> None:
        if self._process is None:
            return
        # The process ends at the end of its input.
        with self._process as process:
            if process.stdin is not None:
                with suppress(OSError):
                    process.stdin.close()
            try:
                process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()


def _write(pipe: IO[bytes], value: object) -> None:
    pipe.write(pickle.dumps(value))
    pipe.flush()


async def _serve() -> None:
    prefer_this_process()
    _, (profile,), named = await asyncio.to_thread(pickle.load, sys.stdin.buffer)
    network = Network(profile, **named)
    try:
        await network.__aenter__()
    except Exception as error:
        _write(sys.stdout.buffer, ("", "", error))
        return
    try:
        result: object = None
        while True:
            _write(sys.stdout.buffer, (network.console_url, network.robot_address, result))
            try:
                method, arguments, named = await asyncio.to_thread(pickle.load, sys.stdin.buffer)
            except (EOFError, OSError):
                return
            result = await _call(network, method, arguments, named)
    finally:
        await network.__aexit__(None, None, None)


async def _call(network: Network, method: str, arguments: tuple[Any, ...], named: dict[str, Any]) -> object:
    if method not in OWN_METHODS:
        return AttributeError(method)
    try:
        found = getattr(network, method)(*arguments, **named)
        return await found if asyncio.iscoroutine(found) else found
    except Exception as error:
        return error


def serve() -> None:
    """Run the network in the process; ends with its input."""
    uvloop.run(_serve())
