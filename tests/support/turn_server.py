"""A real coturn for a test: on loopback, on free ports, with time-limited credentials."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import started
from lockstep.bench.harness.turn_server import turn_command

__all__ = ["TURN_SECRET", "TurnServer", "running_turn_server"]

TURN_SECRET = "only for tests, only on loopback"


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
    port, log = free_port(), directory / "turn.log"
    further = ("--allow-loopback-peers", f"--log-file={log}", "--simple-log", *further)
    async with started(turn_command(directory, "127.0.0.1", port, TURN_SECRET, *further)) as server:
        await server.listening(port)
        yield TurnServer(f"turn:127.0.0.1:{port}?transport=udp", log)
