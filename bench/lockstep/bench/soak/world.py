"""The bridge and the console of a soak: processes that are killed and started again at the same address."""

import asyncio
import re
import secrets
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import httpx

from lockstep.bench.harness.event_log import Record, records
from lockstep.bench.harness.lives import DOWN_SECONDS, BridgeLives, Lives
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.bench.soak.calm import Calm

__all__ = ["World"]

HTTP_SECONDS = 10.0
OPEN_ENCODERS = re.compile(r'^lockstep_media_encoders\{codec="(\w+)",stream="[^"]*"\} ([\d.e+]+)$', re.MULTILINE)


class World:
    """A context manager in which the bridge runs; then call `open_console` with the console's address of the robot."""

    def __init__(self, folder: Path, *options: str, **settings: str) -> None:
        """`options` and `settings` (LOCKSTEP_…): more of them, for the console."""
        self.console_url = ""
        self.operator = self.observer = self.supervisor = ""
        self._options = options
        self.bridge_kills = self.server_restarts = 0
        self._environment = {
            "LOCKSTEP_STATE_DIR": str(folder / "state"),
            "LOCKSTEP_SECRET": secrets.token_urlsafe(32),  # so that links outlive a restart
            **settings,
        }
        self._bridge, self._server = BridgeLives(folder), Lives()
        self._server_port = 0
        self._robot_address = ""
        self.calm = Calm()

    async def __aenter__(self) -> Self:
        await self._bridge.begin()
        return self

    async def open_console(self, robot_address: str) -> None:
        self._robot_address = robot_address
        await self._start_server()

    @property
    def robot(self) -> tuple[str, int]:
        """The address at which the bridge itself listens."""
        return "127.0.0.1", self._bridge.port

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._server.end()
        await self._bridge.end()

    # Disturbances

    async def kill_bridge(self) -> None:
        with self.calm.trouble():
            await self._bridge.kill()
            await self._bridge.begin()
            self.bridge_kills += 1

    async def restart_server(self, *, gently: bool) -> None:
        with self.calm.trouble():
            if gently:
                await self._server.end()
                await asyncio.sleep(DOWN_SECONDS)
            else:
                await self._server.kill()
            await self._start_server()
            self.server_restarts += 1

    async def stop_for(self, seconds: float) -> bool:
        """Press STOP as an observer over HTTP, and reset as the operator later. False if the console was away."""
        async with httpx.AsyncClient(base_url=self.console_url, timeout=HTTP_SECONDS, trust_env=False) as http:
            try:
                stopped = await http.post("/api/stop", headers=_bearer(self.observer), json={"reason": "soak"})
                await asyncio.sleep(seconds)
                await self._reset(http)
            except httpx.TransportError:
                return False
            return stopped.is_success

    async def until_reset(self) -> None:
        """Ask for the reset until the robot is not stopped: one may have been lost in a restart."""
        async with httpx.AsyncClient(base_url=self.console_url, timeout=HTTP_SECONDS, trust_env=False) as http:
            while True:
                try:
                    if await self._reset(http):
                        return
                except httpx.TransportError:
                    pass
                await asyncio.sleep(1.0)

    async def _reset(self, http: httpx.AsyncClient) -> bool:
        """Ask for the reset of the newest stop, by the seat holder's link; return whether no stop holds."""
        session = await http.get("/api/session", headers=_bearer(self.operator))
        if not session.is_success or not session.json()["stopped"]:
            return session.is_success
        number = session.json()["stop"]["number"]
        await http.post("/api/reset", headers=_bearer(self.operator), json={"number": number})
        return False

    # Measurements

    def server_memory(self) -> int | None:
        """Return the server's memory in bytes; None while it is down."""
        try:
            return None if self._server.running is None else self._server.running.usage.resident_bytes()
        except (OSError, ValueError, IndexError):
            return None

    async def open_encoders(self) -> tuple[tuple[str, int], ...] | None:
        """Return the open picture encoders of each codec, by its name; None while the console does not answer."""
        async with httpx.AsyncClient(base_url=self.console_url, timeout=HTTP_SECONDS, trust_env=False) as http:
            try:
                text = (await http.get("/metrics")).text
            except httpx.TransportError:
                return None
        counts: Counter[str] = Counter()
        for codec, count in OPEN_ENCODERS.findall(text):
            counts[codec] += int(float(count))
        return tuple(sorted(counts.items()))

    def records(self) -> Iterator[Record]:
        """Yield the bridge's record of all epochs."""
        return records(self._bridge.event_log)

    async def _start_server(self) -> None:
        command = (LOCKSTEP, "serve", "--json", "--quiet")
        where = ("--robot", self._robot_address, "--port", str(self._server_port))
        ready = await self._server.begin(*command, *where, *self._options, **self._environment)
        self.console_url = ready["console"]
        self.operator, self.supervisor, self.observer = ready["operator"], ready["supervisor"], ready["observer"]
        self._server_port = int(self.console_url.rsplit(":", 1)[1])


def _bearer(link: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {link.partition('#token=')[2]}"}
