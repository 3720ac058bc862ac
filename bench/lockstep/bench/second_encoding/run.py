"""One drive: the robot behind its uplink, the operator on a narrow path, and an observer beside the robot."""

import asyncio
import datetime
import json
import secrets
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from lockstep.bench.figures.samples import quantile
from lockstep.bench.harness.processes import Running, started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.emulator import Profile, load_profile
from lockstep.emulator.impairment.profile import BottleneckSettings
from lockstep.emulator.namespace.three_sites import CONSOLE, Site, ThreeSites
from lockstep.server.http.transport.tls import self_signed

__all__ = ["PORT", "Client", "client_of", "run"]

PORT = 8000
SETTLE = 30.0  # s in which both paths find their measure, and a second encoding has begun where it can
QUEUE_SECONDS = 0.5  # of the operator's path
PATIENCE = 60.0


class Client(NamedTuple):
    """What a client has seen; times in s."""

    sent: list[tuple[int, float]]  # event, when its command was sent
    shown: list[tuple[float, int, int, int]]  # time, stamp, gap, width

    def command_to_picture(self) -> list[float]:
        """Return for each command the time to the first picture that shows its event or a later one, ms."""
        delays, pictures = list[float](), iter(self.shown)
        at, stamp = 0.0, 0
        for event, sent in self.sent:
            while stamp < event or at < sent:
                if (picture := next(pictures, None)) is None:
                    return delays
                at, stamp = picture[0], picture[1]
            delays.append(1000 * (at - sent))
        return delays


async def run(
    network: str, robot: str, operator_bps: float, seconds: float, *, seed: int, second: bool
) -> dict[str, Any]:
    """Drive after half a minute, for `seconds` and until both have seen something since; return the figures.

    Args:
        network: the robot's
        second: a second encoding may be made

    Raises:
        NamespacesUnavailable: this machine or user cannot have network namespaces.
        ProcessFailed: something did not start, or a client was lost.
    """
    with TemporaryDirectory(prefix="lockstep-second-encoding-") as name:
        folder = Path(name)
        made = self_signed(folder, {CONSOLE}, datetime.datetime.now(datetime.UTC))
        key = folder / "robot.key"
        key.touch(mode=0o600)
        key.write_text(secrets.token_urlsafe(32))
        console = [
            *(LOCKSTEP, "serve", "--json", "--quiet", "--robot", "dial-in", "--host", "0.0.0.0"),
            *("--port", str(PORT), "--media-port", str(PORT), "--advertise", CONSOLE, "--link-secret-file", str(key)),
            *("--public-url", f"https://{CONSOLE}:{PORT}", "--state-dir", str(folder / "state")),
            *("--tls-cert", str(made.chain), "--tls-key", str(made.key)),
        ]
        settings = {"LOCKSTEP_MEDIA__SECOND_ENCODING": str(second).lower(), "LOCKSTEP_SCENE": "false"}
        bridge = [
            *(sys.executable, "-m", "lockstep.robot_bridge", robot, "--json", "--encode", "h264"),
            *("--console", f"wss://{CONSOLE}:{PORT}", "--console-ca", str(made.chain)),
            *("--console-key-file", str(key), "--state-dir", str(folder / "bridge")),
        ]
        person = [sys.executable, "-m", "lockstep.bench.second_encoding.person"]
        async with ThreeSites(load_profile(network), _narrow(operator_bps), PORT, seed=seed) as sites:

            def at(site: Site) -> Any:
                return partial(sites.start, site)

            async with started(console, environment=settings, spawn=at("console")) as serving:
                links = json.loads(await serving.line(r'^\{"console"'))
                drives, watches = [
                    [*person, urlsplit(links[role])._replace(scheme="https", netloc=f"{CONSOLE}:{PORT}").geturl()]
                    for role in ("operator", "observer")
                ]
                async with (
                    started(bridge, spawn=at("robot")) as robot_end,
                    started([*drives, str(made.chain)], spawn=at("page")) as operator,
                    started([*watches, str(made.chain)], spawn=at("robot")) as observer,
                ):
                    for client in (operator, observer):
                        await client.read(PATIENCE)
                    await asyncio.sleep(SETTLE)
                    people = (operator, observer)

                    def look() -> tuple[int, float, float]:
                        return sites.sent_bytes("robot", "to_operator"), robot_end.usage.cpu_seconds(), time.monotonic()

                    before = look()
                    for client in people:
                        await client.ask("mark", PATIENCE)
                    await asyncio.sleep(seconds)
                    mine, theirs = [await client_of(client) for client in people]
                    sent, cpu, took = (late - early for late, early in zip(look(), before, strict=True))
    return {
        "robot_kbit_s": round(8 * sent / took / 1000, 1),
        "bridge_cpu_percent": round(100 * cpu / took, 1),
        **_figures(mine, theirs, took),
    }


async def client_of(client: Running) -> Client:
    """End a client and return what it has seen."""
    said = await client.ask("end", PATIENCE)
    return Client([(event, at) for event, at in said["sent"]], [tuple(each) for each in said["shown"]])


def _narrow(bps: float) -> Profile:
    """Return the operator's network."""
    way = BottleneckSettings(bps, round(bps * QUEUE_SECONDS / 8))
    return replace(load_profile("narrow-uplink"), bottleneck_to_operator=way)


def _figures(operator: Client, observer: Client, seconds: float) -> dict[str, Any]:
    delays = operator.command_to_picture()
    mine, theirs = [_median([width for *_, width in each.shown]) for each in (operator, observer)]
    return {
        "events_per_second": round(len(operator.sent) / seconds, 1),
        "command_to_picture_ms": _quantiles(delays),
        "operator_pictures_per_second": round(len(operator.shown) / seconds, 1),
        "operator_width": mine,
        "observer_pictures_per_second": round(len(observer.shown) / seconds, 1),
        "observer_width": theirs,
        "observer_wider_percent": round(
            100 * sum(width > (mine or 0) for *_, width in observer.shown) / max(1, len(observer.shown))
        ),
        "largest_gap": max((abs(gap) for _, _, gap, _ in operator.shown + observer.shown), default=None),
    }


def _quantiles(values: Sequence[float]) -> dict[str, int]:
    """Return the median, the 95th percentile and the largest value."""
    if not values:
        return {}
    return {"median": round(quantile(values, 0.5)), "p95": round(quantile(values, 0.95)), "worst": round(max(values))}


def _median(values: Sequence[int]) -> int | None:
    return round(quantile(values, 0.5)) if values else None
