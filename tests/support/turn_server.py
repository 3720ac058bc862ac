"""A real coturn for a test: on loopback, on free ports, with time-limited credentials."""

import asyncio
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from lockstep.bench.harness.free_port import free_port

__all__ = ["TURN_SECRET", "TurnServer", "running_turn_server"]

TURN_SECRET = "only for tests, only on loopback"
START_SECONDS = 15.0
STOP_SECONDS = 5.0


@dataclass
class TurnServer:
    uri: str  # "turn:127.0.0.1:PORT?transport=udp"
    log: Path

    def says(self, text: str) -> bool:
        """Whether its log has `text`."""
        return text in self.log.read_text(errors="replace")


@asynccontextmanager
async def running_turn_server(directory: Path, *further: str) -> AsyncIterator[TurnServer]:
    """Started, answering on UDP and TCP, ended on leaving. `further`: options of coturn."""
    executable = shutil.which("turnserver")
    if executable is None:
        raise RuntimeError("coturn is not installed: make test installs Debian's coturn")
    port, log = free_port(), directory / "turn.log"
    command = [
        *(executable, "-n", "--listening-ip=127.0.0.1", "--relay-ip=127.0.0.1", f"--listening-port={port}"),
        *("--use-auth-secret", f"--static-auth-secret={TURN_SECRET}", "--realm=lockstep.test", "--fingerprint"),
        *("--allow-loopback-peers", "--no-tls", "--no-dtls", "--no-cli", "--verbose"),
        *(f"--log-file={log}", "--simple-log", f"--pidfile={directory / 'turn.pid'}", f"--userdb={directory / 'db'}"),
        *further,
    ]
    with (directory / "turn.out").open("wb") as output:
        process = await asyncio.create_subprocess_exec(*command, stdout=output, stderr=output)
    try:
        await _answers(port, process)
        yield TurnServer(f"turn:127.0.0.1:{port}?transport=udp", log)
    finally:
        if process.returncode is None:
            process.terminate()
        try:
            async with asyncio.timeout(STOP_SECONDS):
                await process.wait()
        except TimeoutError:
            process.kill()
            await process.wait()


async def _answers(port: int, process: asyncio.subprocess.Process) -> None:
    async with asyncio.timeout(START_SECONDS):
        while True:
            if process.returncode is not None:
                raise RuntimeError(f"coturn ended with {process.returncode}")
            try:
                _, writer = await asyncio.open_connection("127.0.0.1", port)
            except OSError:
                await asyncio.sleep(0.05)
                continue
            writer.close()
            await writer.wait_closed()
            return
