"""A real Redis of a test's own: on a free port, in its own directory, ended by its process id."""

import asyncio
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path
from types import TracebackType

import redis.asyncio

from lockstep.bench.harness.free_port import free_port
from tests.waiting import PATIENCE

__all__ = ["RedisServer"]


class RedisServer:
    """Enter it. What it kept is gone after `kill`, as that of a machine that is lost."""

    def __init__(self, directory: Path, *options: str, password: str = "", encrypted: bool = False) -> None:
        self.port = free_port()
        self._encrypted = encrypted
        self.password = password
        self._directory = directory
        self._options = options
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        secret = f":{self.password}@" if self.password else ""
        return f"{'rediss' if self._encrypted else 'redis'}://{secret}127.0.0.1:{self.port}/0"

    async def start(self) -> None:
        program = shutil.which("redis-server")
        assert program is not None, "redis-server is not installed; `make test` installs it"
        settings = ["--bind", "127.0.0.1", "--dir", str(self._directory)]
        settings += ["--port", "0", "--tls-port"] if self._encrypted else ["--port"]
        settings += [str(self.port)]
        settings += ["--save", "", "--appendonly", "no", "--daemonize", "no"]
        settings += ["--requirepass", self.password] if self.password else []
        self._process = await asyncio.to_thread(_spawn, [program, *settings, *self._options])
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                _, writer = await asyncio.open_connection("127.0.0.1", self.port)
            except OSError:
                assert self._process.poll() is None, "redis-server ended"
                assert time.monotonic() < deadline, "redis-server does not listen"
                await asyncio.sleep(0.01)
            else:
                writer.close()
                await writer.wait_closed()
                return

    def client(self) -> "redis.asyncio.Redis":
        return redis.asyncio.Redis.from_url(self.url, protocol=2)

    def hang(self) -> None:
        self._signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self._signal(signal.SIGCONT)

    def kill(self) -> None:
        if self._process is not None:
            self._signal(signal.SIGKILL)
            self._process.wait(PATIENCE)
            self._process = None

    def _signal(self, number: signal.Signals) -> None:
        assert self._process is not None
        os.kill(self._process.pid, number)

    async def __aenter__(self) -> "RedisServer":
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()


def _spawn(command: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
