"""Measures what viewers of the live session cost the operator: command to feedback beside the same without viewers.

Viewers of the Foxglove server read everything, read nothing, or subscribe and unsubscribe without end. Rerun gets the
session in a file, in a viewer that reads, in one that never does, and by a server that connections flood. All take
turns with no viewer, so that the machine's other work falls on all of them.
"""

import socket
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.driving import console_trips
from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import running_process, started
from lockstep.bench.harness.stack import running_stack
from lockstep.bench.viewers.idle_crowd import IDLE
from lockstep.client import Console, NotArmed

__all__ = ["run", "viewer_program"]

SECTION = "live_tools"
ROBOT = "planar"
EVENTS, QUICK_EVENTS = 250, 15  # of a turn
TURNS, QUICK_TURNS = 3, 1
VIEWERS, QUICK_VIEWERS = 30, 2
ATTEMPTS = 20
ALLOWED = 1.1  # times the operator's time without viewers
FOXGLOVE = {
    "reads": "viewers in Foxglove's protocol read everything",
    "reads_nothing": "viewers in Foxglove's protocol read nothing",
    "floods": "viewers in Foxglove's protocol subscribe and unsubscribe without end",
}
RERUN = {
    "file": "Rerun writes a file",
    "reads": "a viewer of Rerun's reads everything",
    "reads_nothing": "a viewer of Rerun's never reads",
    "floods": "connections flood Rerun's server",
}
NONE = "none"


async def run(context: Context) -> list[Result]:
    times = await _foxglove(context)
    results = _compare(times, FOXGLOVE, context)
    times = await _rerun(context)
    return results + _compare(times, RERUN, context)


async def _foxglove(context: Context) -> dict[str, list[float]]:
    """Return the times in ms by kind of viewers, all on one console."""
    port, count = free_port(), context.scale(VIEWERS, QUICK_VIEWERS)
    times: dict[str, list[float]] = {kind: [] for kind in (NONE, *FOXGLOVE)}
    async with running_stack(ROBOT, LOCKSTEP_FOXGLOVE__PORT=str(port)) as stack, _operator(stack.operator) as console:
        for _ in range(context.scale(TURNS, QUICK_TURNS)):
            for kind, found in times.items():
                context.say(f"Foxglove, {kind}")
                async with AsyncExitStack() as viewers:
                    if kind != NONE:
                        await viewers.enter_async_context(_crowd("foxglove_crowd", port, kind, count))
                    found += await _trips(console, context)
    return times


async def _rerun(context: Context) -> dict[str, list[float]]:
    """Return the times in ms by what takes the session, each on a console of its own."""
    times: dict[str, list[float]] = {kind: [] for kind in (NONE, *RERUN)}
    for _ in range(context.scale(TURNS, QUICK_TURNS)):
        for kind, found in times.items():
            context.say(f"Rerun, {kind}")
            async with AsyncExitStack() as taking:
                settings, port = await _taker(taking, kind)
                stack = await taking.enter_async_context(
                    running_stack(ROBOT, is_logged=True, is_secured=False, **settings)
                )
                if kind == "floods":
                    count = context.scale(VIEWERS, QUICK_VIEWERS)
                    await taking.enter_async_context(_crowd("connection_flood", port, "floods", count))
                console = await taking.enter_async_context(_operator(stack.operator))
                found += await _trips(console, context)
    return times


async def _taker(taking: AsyncExitStack, kind: str) -> tuple[Mapping[str, str], int]:
    """Start what takes the session, and return the settings that name it, and its port."""
    folder = Path(taking.enter_context(TemporaryDirectory(prefix="lockstep-bench-")))
    port = free_port()
    match kind:
        case "file":
            return {"LOCKSTEP_RERUN__TO": str(folder / "a.rrd")}, 0
        case "reads":
            command = (
                *IDLE,
                str(viewer_program()),
                "--save",
                str(folder / "b.rrd"),
                "--port",
                str(port),
                "--bind",
                "127.0.0.1",
            )
            await taking.enter_async_context(_listening(command, port, folder))
            return {"LOCKSTEP_RERUN__TO": f"127.0.0.1:{port}"}, port
        case "reads_nothing":
            taking.enter_context(socket.create_server(("127.0.0.1", port)))
            return {"LOCKSTEP_RERUN__TO": f"127.0.0.1:{port}"}, port
        case "floods":
            return {"LOCKSTEP_RERUN__TO": str(port), "LOCKSTEP_RERUN__PUBLIC": "true"}, port
    return {}, 0


def viewer_program() -> Path:
    """Return Rerun's viewer itself: the script `rerun` only starts it, and leaves it running when it is ended."""
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise ModuleNotFoundError("rerun-sdk is not installed")
    return Path(found.origin).with_name("rerun")


@asynccontextmanager
async def _listening(command: tuple[str, ...], port: int, home: Path) -> AsyncIterator[None]:
    async with started(command, environment={"HOME": str(home)}) as process:
        await process.listening(port)
        yield


@asynccontextmanager
async def _crowd(module: str, port: int, kind: str, count: int) -> AsyncIterator[None]:
    command = (*IDLE, sys.executable, "-m", f"lockstep.bench.viewers.{module}", str(port), kind, str(count))
    async with running_process(*command):
        yield


@asynccontextmanager
async def _operator(link: str) -> AsyncIterator[Console]:
    async with Console(link, name="bench", codec="H264") as console:
        await console.take_seat()
        yield console


async def _trips(console: Console, context: Context) -> list[float]:
    wanted, found = context.scale(EVENTS, QUICK_EVENTS), list[float]()
    for _ in range(ATTEMPTS):
        with suppress(NotArmed):  # a busy machine held the robot up, again and again
            trips = await console_trips(console, wanted - len(found))
            found += [trip.seconds * 1000 for trip in trips]
        if len(found) >= wanted:
            break
    return found


def _compare(times: Mapping[str, list[float]], kinds: Mapping[str, str], context: Context) -> list[Result]:
    without = times[NONE]
    count = context.scale(VIEWERS, QUICK_VIEWERS)
    found = []
    for kind, words in kinds.items():
        for name, share in (("median", 0.5), ("p95", 0.95)):
            baseline = median(without) if share == 0.5 else quantile(without, share)
            found.append(
                Result(
                    section=SECTION,
                    name=f"command → feedback while {words}, {name}",
                    value=median(times[kind]) if share == 0.5 else quantile(times[kind], share),
                    unit="ms",
                    target=baseline * ALLOWED if share == 0.5 else None,
                    baseline=baseline,
                    baseline_name="the same without viewers",
                    samples=len(times[kind]),
                    conditions=f"{ROBOT}; {count} viewers or connections where there are several, at idle priority",
                )
            )
    return found
