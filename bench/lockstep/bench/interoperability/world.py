"""The world of a cell without its client: a robot, a console and a way between them, each in its own network."""

import json
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from lockstep.bench.harness.processes import Running, Spawn, spawn_here, started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.bench.harness.turn_server import turn_command
from lockstep.bench.interoperability.names import Client, Way
from lockstep.bench.relay.janus import JANUS_READY, janus_command
from lockstep.bench.relay.stage import FIRST_PORT, ROOM
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.profile import Profile, even_profile
from lockstep.emulator.namespace.namespaces import ROBOT_ADDRESS, Namespaces, Side

__all__ = ["World", "running_world"]

CLOUD = "203.0.113.7"  # from the block for documentation (RFC 5737)
ONE_WAY = 0.3  # s
PORT = 8000
TURN_PORT, TURN_SECRET = 3478, "only between these two namespaces"


class _Starter:
    """Starts processes in the networks of both sides; in this machine's own if `spaces` is None."""

    def __init__(self, stack: AsyncExitStack, spaces: Namespaces | None) -> None:
        self._stack = stack
        self._spaces = spaces

    async def start(self, side: Side, command: list[str], **environment: str) -> Running:
        spawn: Spawn = spawn_here if self._spaces is None else partial(self._spaces.start, side)
        return await self._stack.enter_async_context(started(command, environment=environment, spawn=spawn))


@dataclass(frozen=True)
class World:
    """The running processes, and the `links` to each console.

    The links are "operator" and "observer" as the client reaches the console, and "near" from beside the console.
    """

    links: tuple[dict[str, str], ...]
    doors: tuple[str, ...]  # host:port of each console; "": the link is at loopback
    starter: _Starter

    async def visit(self, command: list[str]) -> Running:
        """Start the client's process, on its side of the way."""
        return await self.starter.start("operator", command)

    async def drive(self, number: int) -> None:
        """Drive beside this console, so that events go on for clients that only watch."""
        command = [sys.executable, "-m", "lockstep.bench.relay.driver", self.links[number]["near"], "0"]
        driver = await self.starter.start("robot", command)
        await driver.line(r'^\{"at"')


@asynccontextmanager
async def running_world(way: Way, client: Client) -> AsyncIterator[World]:
    """Start a world.

    Raises:
        NamespacesUnavailable: this machine or user cannot have network namespaces.
        FileNotFoundError: a program is missing.
        ProcessFailed: something did not start.
    """
    async with AsyncExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="lockstep-interoperability-")))
        spaces = None
        if way != "ipv6":
            profile = even_profile("far", Impairment(delay=Constant(ONE_WAY))) if way == "far" else Profile("perfect")
            cloud = CLOUD if way == "nat" else None
            spaces = await stack.enter_async_context(Namespaces(profile, cloud=cloud, passes_udp=way != "tcp"))
        starter = _Starter(stack, spaces)
        if way == "turn":
            await _start_turn(starter, folder)
        links, doors = [], []
        for number in range(2 if way == "two" else 1):
            if client == "janus":
                janus = await starter.start(
                    "robot", janus_command(folder / f"janus{number}", ROBOT_ADDRESS, FIRST_PORT + number, number=number)
                )
                await janus.line(JANUS_READY)
            made = await _start_console(starter, way, client, number, folder / f"console{number}")
            links.append(made)
            address = CLOUD if way == "nat" else ROBOT_ADDRESS
            doors.append("" if way == "ipv6" else f"{address}:{PORT + number}")
        yield World(tuple(links), tuple(doors), starter)


async def _start_console(starter: _Starter, way: Way, client: Client, number: int, folder: Path) -> dict[str, str]:
    host = {"ipv6": "::1", "nat": "0.0.0.0"}.get(way, ROBOT_ADDRESS)
    port = 0 if way == "ipv6" else PORT + number
    command = [
        *(LOCKSTEP, "up", "--json", "--robot", "planar", "--robot-port", "0"),
        *("--host", host, "--port", str(port), "--state-dir", str(folder), "--quiet"),
    ]
    command += ["--media-port", str(40000 + number), "--media-tcp"] if way == "tcp" else []
    command += ["--advertise", CLOUD] if way == "nat" else []
    command += [f"--relay=janus:ws://{ROBOT_ADDRESS}:{FIRST_PORT + number}/{ROOM}"] if client == "janus" else []
    turn = {"LOCKSTEP_TURN": f"turn:{ROBOT_ADDRESS}:{TURN_PORT}?transport=udp", "LOCKSTEP_TURN_SECRET": TURN_SECRET}
    console = await starter.start("robot", command, **(turn if way == "turn" else {}))
    said = json.loads(await console.line(r'^\{"console"'))
    suffix = "&relay=only" if way == "turn" else ""
    return {
        "operator": said["operator"] + suffix,
        "observer": said["observer"] + suffix,
        "near": said["operator"].replace(CLOUD, ROBOT_ADDRESS),
    }


async def _start_turn(starter: _Starter, folder: Path) -> None:
    command = turn_command(folder, ROBOT_ADDRESS, TURN_PORT, TURN_SECRET, "--log-file=stdout")
    server = await starter.start("robot", command)
    await server.line("(?i)listener opened on|IPv4. UDP listener")
