"""One drive of a robot behind NAT, through a console behind another with one open port, by a page behind a third."""

import asyncio
import datetime
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

from lockstep.bench.experiment.judge.outage_judge import Cut
from lockstep.bench.harness.event_log import records
from lockstep.bench.harness.processes import started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.bench.robot_cuts.cuts import cut_once, judged, until_driven
from lockstep.bench.robot_cuts.cuts import figures as cut_figures
from lockstep.emulator import load_profile
from lockstep.emulator.namespace.three_sites import CONSOLE, Site, ThreeSites
from lockstep.server.http.transport.tls import self_signed

__all__ = ["PORT", "run"]

PORT = 8000  # the console's only open one: TCP for HTTP and the robot link, UDP for media and data channels
SETTLE = 5.0  # s
PAGE_SECONDS = 240.0  # for the page to open, to drive and to say what it saw, besides the drive itself


async def run(
    robot: str,
    page: str,
    seconds: float,
    seed: int,
    say: Callable[[str], None],
    *,
    cuts: int = 0,
    settle: float = SETTLE,
) -> dict[str, Any]:
    """Pair, open the page and drive for `seconds`; return what was seen.

    Args:
        robot, page: profiles of their networks
        cuts: how often the robot's network is cut, `seconds` each time; 0 for a drive without cuts
        settle: s of driving before those, in which the bitrate finds its measure

    Raises:
        NamespacesUnavailable: this machine or user cannot have network namespaces.
        ProcessFailed: something did not start.
        TimeoutError: the page did not drive.
    """
    with TemporaryDirectory(prefix="lockstep-three-networks-") as name:
        folder = Path(name)
        made = self_signed(folder, {CONSOLE}, datetime.datetime.now(datetime.UTC))
        async with ThreeSites(load_profile(robot), load_profile(page), PORT, seed=seed) as sites:
            console = [
                *(LOCKSTEP, "serve", "--json", "--quiet", "--robot", "dial-in", "--host", "0.0.0.0"),
                *("--port", str(PORT), "--media-port", str(PORT), "--advertise", CONSOLE),
                *("--public-url", f"https://{CONSOLE}:{PORT}"),
                *("--tls-cert", str(made.chain), "--tls-key", str(made.key), "--state-dir", str(folder / "state")),
            ]
            async with started(console, spawn=partial(sites.start, "console")) as serving:
                links = json.loads(await serving.line(r'^\{"console"'))
                # A supervisor at the page's site asks for the code: the console's router does not lead back to it.
                pairing = [
                    LOCKSTEP,
                    "pair",
                    "--json",
                    "--tls-ca",
                    str(made.chain),
                    "--link",
                    _outside(links["supervisor"]),
                ]
                code = json.loads(await _output(sites, "page", pairing))["code"]
                say("the console has given a code")
                log = folder / "events.jsonl"
                bridge = [
                    *(sys.executable, "-m", "lockstep.robot_bridge", "planar", "--json", "--encode", "h264"),
                    *("--console", f"wss://{CONSOLE}:{PORT}", "--pair", code),
                    *("--event-log", str(log), "--state-dir", str(folder / "bridge")),
                ]
                async with started(bridge, spawn=partial(sites.start, "robot")):
                    cut, seen = await _driven(sites, _outside(links["operator"]), log, cuts, seconds, settle, say)
                    say("the page has driven")
            found = list(records(log))
        told = cut_figures(judged(found, cut, partial(sites.planned_silence, "robot"))) if cuts else {}
        return {**told, **_figures(seen, found, sites.router.refused)}


async def _driven(
    sites: ThreeSites, link: str, log: Path, cuts: int, seconds: float, settle: float, say: Callable[[str], None]
) -> tuple[list[Cut], dict[str, Any]]:
    """Let the page drive; return the cuts, and what the page says that it saw."""
    command = [sys.executable, "-m", "lockstep.bench.three_networks.page", link, str(settle)]
    if not cuts:
        async with asyncio.timeout(PAGE_SECONDS + seconds):
            return [], json.loads(await _output(sites, "page", [*command, str(seconds)]))
    process = await sites.start("page", command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    await until_driven(log, time.monotonic())
    await asyncio.sleep(settle)
    cut = partial(sites.outage, "robot")
    made = [await cut_once(log, cut, seconds, number, say) for number in range(cuts)]
    async with asyncio.timeout(PAGE_SECONDS):
        output, _ = await process.communicate(b"")  # and end its input
    return made, json.loads(output)


def _outside(link: str) -> str:
    """Return a link of the console with its outer address."""
    return urlsplit(link)._replace(scheme="https", netloc=f"{CONSOLE}:{PORT}").geturl()


async def _output(sites: ThreeSites, site: Site, command: list[str]) -> bytes:
    process = await sites.start(site, command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    assert process.stdout is not None
    return await process.stdout.read()


def _figures(seen: dict[str, Any], log: list[Any], refused: Counter[Site]) -> dict[str, Any]:
    """Return what the page's statistics say, what the bridge executed, and what the routers did not let in."""
    moved = sum(each["kind"] == "executed" and any(each["values"]) for each in log)
    kinds = Counter(each["kind"] for each in log)
    # The robot comes to rest by itself when no command came within its hold; a page that disarms asks for rest.
    return {
        "moving_commands_executed": moved,
        "came_to_rest": kinds["at_rest"],
        "rests_asked_for": sum(each["kind"] == "rest" and bool(each["applied"]) for each in log),
        "stalls": kinds["stall"],
        "refused_commands": dict(Counter(each["reason"] for each in log if each["kind"] == "refused")),
        "refused_packets": dict(refused),
        **seen,
    }
