"""Drives a robot undisturbed, then among the crowd, then undisturbed again, and compares the operator's times.

The crowd comes directly, with TLS, or through a real Caddy with deploy/Caddyfile.
"""

import asyncio
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from random import Random
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

from lockstep.bench.figures.machine import busy_percent, machine_facts
from lockstep.bench.harness.caddy import running_caddy
from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import Running, running_process
from lockstep.bench.harness.stack import Stack, running_stack
from lockstep.client import Console
from lockstep.protocol.neutral import neutral_values

__all__ = ["FRONTS", "hostile", "memory_of"]

FRONTS = ("direct", "tls", "caddy")  # the crowd's ways to the console

WARM_UP = 3.0  # s
INTERVAL = (0.046, 0.054)  # s between commands: spread over two ticks of the robot, or each waits for its tick alike
ALLOWED = 1.2  # times the undisturbed median
CROWD_SECONDS = 60.0  # until the crowd has an answer


async def hostile(
    peers: int, seconds: float, seed: int, say: Callable[[str], None], kind: str = "", front: str = "direct"
) -> dict[str, Any]:
    """Run the comparison and return its figures; `say` reports the progress.

    `kind`: one of the crowd's alone; "": all of them together.
    """
    before = await busy_percent(1.0)
    settings: dict[str, Any] = {"LOCKSTEP_WHIP": "phone"} | ({"LOCKSTEP_TLS": "self-signed"} if front == "tls" else {})
    async with running_stack("planar", is_secured=True, **settings) as stack, _entry(stack, front) as link:
        trusted = str(stack.bridge.event_log.parent / "state" / "tls-cert.pem") if front == "tls" else None
        async with Console(stack.operator, video=1, audio=False, name="operator", tls_ca=trusted) as console:
            await console.take_seat()
            await _drive(console, WARM_UP)
            say(f"driving in peace for {seconds / 2:g} s")
            quiet = await _drive(console, seconds / 2)
            memory = memory_of(stack.console)
            command = (
                sys.executable,
                "-m",
                "lockstep.bench.hostile.crowd",
                "--idle",
                link,
                stack.operator,
                *(stack.bridge.address, str(peers), str(seed), kind),
            )
            async with running_process(*command) as (crowd, _):
                say(f"{peers} misbehaving peers ({kind or 'all kinds'}, {front}) for {seconds:g} s")
                used = stack.console.usage.cpu_seconds()
                disturbed = await _drive(console, seconds)
                used = stack.console.usage.cpu_seconds() - used
                took = crowd.usage.cpu_seconds()
                seen = await crowd.ask("", CROWD_SECONDS)
                memory_during = memory_of(stack.console)
                places = 0.0 if front == "tls" else await _peers(stack)
            say(f"driving in peace for {seconds / 2:g} s")
            await _drive(console, WARM_UP)
            quiet += await _drive(console, seconds / 2)
            await console.rest()
        return {
            "kind": kind or "all",
            "front": front,
            "peers": peers,
            "seconds": seconds,
            "quiet_ms": _figures(quiet),
            "disturbed_ms": _figures(disturbed),
            "ratio": round(median(disturbed) / median(quiet), 3),
            "allowed": ALLOWED,
            "console_cpu_percent": round(100 * used / seconds, 1),
            "crowd_cpu_seconds": round(took, 1),
            "memory_mib": {"before": memory, "among_them": memory_during, "after": memory_of(stack.console)},
            "peers_at_the_end": places,
            "refused": {} if front == "tls" else await _refused(stack),
            "crowd": seen,
            "machine": machine_facts() | {"busy_percent_before": round(before, 1)},
        }


@asynccontextmanager
async def _entry(stack: Stack, front: str) -> AsyncIterator[str]:
    """Yield the observer's link by which the crowd comes."""
    if front != "caddy":
        yield stack.observer
        return
    with TemporaryDirectory(prefix="lockstep-caddy-") as folder:
        port = str(urlsplit(stack.url).port)
        async with running_caddy("Caddyfile", Path(folder), free_port(), LOCKSTEP_PORT=port) as address:
            yield stack.observer.replace(stack.url, address)


async def _drive(console: Console, seconds: float) -> list[float]:
    """Return the seconds from each command's first sending to its feedback."""
    end, taken = time.monotonic() + seconds, list[float]()
    values, random = neutral_values(console.description.axes), Random(1)
    while time.monotonic() < end:
        began = time.perf_counter()
        await console.drive(values)
        taken.append(time.perf_counter() - began)
        await asyncio.sleep(random.uniform(*INTERVAL))
    return taken


def _figures(taken: list[float]) -> dict[str, float]:
    cuts = quantiles(taken, n=100)
    found = {"median": median(taken), "p95": cuts[94], "p99": cuts[98], "max": max(taken)}
    return {name: round(1000 * value, 2) for name, value in found.items()} | {"commands": len(taken)}


def memory_of(process: Running) -> float:
    """Return the resident memory in MiB (proc(5), /proc/pid/status)."""
    for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return round(int(line.split()[1]) / 1024, 1)
    return 0.0


async def _refused(stack: Stack) -> dict[str, dict[str, float]]:
    """Return the refusals by name and place, and the reasons for ended peers."""
    metrics = await stack.metrics()
    found = {
        where: metrics.values("lockstep_bad_input_total", "reason", where=where)
        for where in ("http", "control", "session", "stop", "other", "transport")
    }
    found["refusals"] = metrics.values("lockstep_refusals_total", "reason")
    found["ended"] = metrics.values("lockstep_peers_ended_total", "why")
    found["internal_errors"] = metrics.values("lockstep_internal_errors_total", "where")
    return {name: values for name, values in found.items() if values}


async def _peers(stack: Stack) -> float:
    return sum((await stack.metrics()).values("lockstep_peers", "role").values())
