"""Starts a robot bridge and a console, each in a separate process, so that the time of each can be told."""

import asyncio
import datetime
import secrets
import sys
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

import httpx
from prometheus_client.parser import text_string_to_metric_families

from lockstep.bench.harness.processes import ProcessFailed, Running, running_process
from lockstep.server.http.transport.tls import self_signed

__all__ = [
    "DEFAULT_ROBOT",
    "LOCKSTEP",
    "Bridge",
    "Metrics",
    "Stack",
    "available_robots",
    "running_bridge",
    "running_console",
    "running_stack",
]

DEFAULT_ROBOT = "mobile-manipulator"
LOCKSTEP = str(Path(sys.executable).with_name("lockstep"))
ROBOTS = (DEFAULT_ROBOT, "planar")
HTTP_SECONDS = 30.0
METRICS_ADDRESS = "127.0.0.2"
TRIES = 30  # for the counters, each after a Retry-After
MAX_PEERS = 300  # more than any section needs


@dataclass(frozen=True)
class Bridge:
    robot: str
    process: Running
    address: str  # "tcp://127.0.0.1:5600"
    event_log: Path  # exists only if it was asked for
    settings: Mapping[str, str]  # for a console that connects to it, LOCKSTEP_…

    @property
    def port(self) -> int:
        return urlsplit(self.address).port or 0


@dataclass(frozen=True)
class Stack:
    bridge: Bridge
    console: Running
    url: str  # "http://127.0.0.1:8000"
    operator: str  # links with a token
    observer: str

    async def metrics(self) -> "Metrics":
        """Return the console's counters now.

        A console here is asked from an address of its own: those of this address may have used up its requests and
        connections.
        """
        is_here = urlsplit(self.url).hostname == "127.0.0.1"
        way = httpx.AsyncHTTPTransport(local_address=METRICS_ADDRESS if is_here else None)
        async with httpx.AsyncClient(transport=way, trust_env=False, timeout=HTTP_SECONDS) as http:
            for _ in range(TRIES):
                answer = await http.get(f"{self.url}/metrics")
                if answer.status_code != httpx.codes.TOO_MANY_REQUESTS:
                    break
                await asyncio.sleep(float(answer.headers["Retry-After"]))
            return Metrics(answer.raise_for_status().text)


class Metrics:
    """Counters in the Prometheus text format."""

    def __init__(self, text: str) -> None:
        self._samples = [sample for family in text_string_to_metric_families(text) for sample in family.samples]

    def values(self, name: str, by: str, **where: str) -> dict[str, float]:
        """Return a counter: a value for each value of the label `by`, with the other labels as in `where`."""
        return {
            sample.labels[by]: sample.value
            for sample in self._samples
            if sample.name == name and where.items() <= sample.labels.items()
        }


@asynccontextmanager
async def running_bridge(
    robot: str, *, is_logged: bool = True, is_secured: bool = False, options: Sequence[str] = ()
) -> AsyncIterator[Bridge]:
    """Start a bridge.

    `is_logged`: it writes its event log, which costs some processor time. `is_secured`: its link speaks TLS and asks
    for a secret. `options`: further ones of the command.

    Raises:
        ProcessFailed: something that the robot needs is missing here.
    """
    with TemporaryDirectory(prefix="lockstep-bench-") as directory:
        log = Path(directory) / "events.jsonl"
        command = (sys.executable, "-m", "lockstep.robot_bridge", robot, "--port", "0", "--event-strip", "--json")
        state = ("--state-dir", str(Path(directory) / "bridge"))
        logging = ("--event-log", str(log)) if is_logged else ()
        security, settings = _security(Path(directory)) if is_secured else ((), {})
        async with running_process(*command, *state, *logging, *security, *options, environment=settings) as (
            process,
            ready,
        ):
            yield Bridge(robot, process, ready["robot"], log, settings)


def _security(folder: Path) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the options of a bridge, and the environment of both it and its console."""
    made = self_signed(folder, {"127.0.0.1"}, datetime.datetime.now(datetime.UTC))
    settings = {"LOCKSTEP_LINK_SECRET": secrets.token_hex(16), "LOCKSTEP_LINK_TLS_CA": str(made.chain)}
    return ("--link-tls-cert", str(made.chain), "--link-tls-key", str(made.key)), settings


@asynccontextmanager
async def running_console(
    *robots: str, port: int = 0, environment: Mapping[str, str]
) -> AsyncIterator[tuple[Running, dict[str, Any]]]:
    """Start a console for robots, "tcp://host:port" or, of a fleet, "name=tcp://host:port"; yield its links too."""
    named = (f"--robot={robot}" for robot in robots)
    command = (LOCKSTEP, "serve", *named, "--port", str(port), "--json", "--quiet")
    async with running_process(*command, environment=environment) as started:
        yield started


@asynccontextmanager
async def running_stack(
    robot: str, *, is_logged: bool = True, is_secured: bool = False, **more: str
) -> AsyncIterator[Stack]:
    """Start a bridge, as `running_bridge` does, and a console. `more`: further settings of the console, LOCKSTEP_…"""
    async with running_bridge(robot, is_logged=is_logged, is_secured=is_secured) as bridge:
        settings = {"LOCKSTEP_STATE_DIR": str(bridge.event_log.parent / "state"), "LOCKSTEP_MAX_PEERS": str(MAX_PEERS)}
        settings |= dict(bridge.settings) | more
        async with running_console(bridge.address, environment=settings) as (console, links):
            yield Stack(bridge, console, links["console"], links["operator"], links["observer"])


async def available_robots() -> list[str]:
    """Return the robots that start here: the default robot needs OpenGL."""
    found = []
    for robot in ROBOTS:
        try:
            async with running_bridge(robot):
                found.append(robot)
        except ProcessFailed:
            continue
    return found
