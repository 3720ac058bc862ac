"""Two Janus servers beside the console, which are killed and started again at the same address."""

from contextlib import AsyncExitStack
from pathlib import Path

from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import Running, started
from lockstep.bench.relay.janus import JANUS_READY, janus_command
from lockstep.rtc.interfaces import own_addresses

__all__ = ["NoAddress", "Relays"]

ROOM = 4711
COUNT = 2


class NoAddress(Exception):
    """This machine has only loopback addresses, over which Janus sends no media."""


class Relays:
    """Call `begin`, then use the addresses; `end` kills all of them."""

    def __init__(self, folder: Path) -> None:
        """Raises NoAddress."""
        addresses = [each for each in own_addresses() if ":" not in each]
        if not addresses:
            raise NoAddress("a relay needs an IPv4 address of this machine that is not loopback")
        self._address = addresses[0]
        self._folder = folder
        self._ports = [free_port() for _ in range(COUNT)]
        self._running: dict[int, Running] = {}
        self._stacks = [AsyncExitStack() for _ in range(COUNT)]
        self._turn = 0

    @property
    def options(self) -> list[str]:
        """The options that name the relays to the console."""
        return [f"--relay=janus:ws://{self._address}:{port}/{ROOM}" for port in self._ports]

    async def begin(self) -> None:
        """Start all. Raises FileNotFoundError, ProcessFailed."""
        for number in range(COUNT):
            await self._start(number)

    async def kill_one(self) -> None:
        """Kill the next server in turn, as a crash does, and start it again; it remembers nothing."""
        number, self._turn = self._turn, (self._turn + 1) % COUNT
        await self._running[number].kill()
        await self._stacks[number].aclose()
        await self._start(number)

    async def end(self) -> None:
        for stack in self._stacks:
            await stack.aclose()

    async def _start(self, number: int) -> None:
        command = janus_command(self._folder / f"janus-{number}", self._address, self._ports[number], number=number)
        stack = self._stacks[number] = AsyncExitStack()
        self._running[number] = await stack.enter_async_context(started(command))
        await self._running[number].line(JANUS_READY)
