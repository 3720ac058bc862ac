"""One robot in a network namespace of its own, which is cut in mid-drive: the console and the operator are outside.

Linux and root only. The cut loses every packet of the robot. What happened is told by the bridge's own log.
"""

import asyncio
import contextlib
import datetime
import json
import secrets
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal
from urllib.parse import urlsplit

from lockstep.bench.experiment.judge.outage_judge import Cut, Finding, judge_outage
from lockstep.bench.harness.event_log import Record, records
from lockstep.bench.harness.processes import Spawn, started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.emulator import load_profile
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.profile import even_profile
from lockstep.emulator.namespace.namespaces import OPERATOR_ADDRESS, ROBOT_ADDRESS, Namespaces
from lockstep.emulator.namespace.three_sites import CONSOLE, SITES, ThreeSites
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.server.http.transport.tls import self_signed

__all__ = ["RETURN_SECONDS", "Way", "figures", "run_cuts", "with_silence"]

# The console connects to the robot, the robot to the console, or that with each of robot, console and operator behind a
# router of its own.
Way = Literal["reached", "dial-in", "behind-nat"]

HTTP_PORT, ROBOT_PORT = 8000, 5600
ONE_WAY = 0.02  # s
BEFORE = 1.5  # s of driving before each cut
BEFORE_LOG = 1.0  # s of the log before a cut that its judge reads
AFTER = 0.5  # s of driving after control returned
PATIENCE = 60.0  # s to wait for control to return
LOOK = 0.1
RETURN_SECONDS = 2.0


@dataclass(frozen=True)
class _Place:
    """Where the processes run, and how the robot is cut off.

    `host` is where the console listens, `address` where the robot and the operator find it.
    """

    folder: Path
    robot: Spawn
    console: Spawn
    operator: Spawn
    host: str
    address: str
    cut: Callable[[float], None]  # for seconds
    silence: Callable[[float, float], float]  # s of the path's own outages between two times

    @property
    def log(self) -> Path:
        return self.folder / "events.jsonl"

    @property
    def intentions(self) -> Path:
        return self.folder / "intentions.jsonl"


@asynccontextmanager
async def _on_one_path(folder: Path, seed: int) -> AsyncIterator[_Place]:
    """Console and operator on one side, the robot on the other, 40 ms of round trip between them."""
    profile = even_profile("robot-cut", Impairment(delay=Constant(ONE_WAY)))
    async with Namespaces(profile, seed=seed) as spaces:

        def cut(seconds: float) -> None:
            for robot_link in (True, False):  # the packets of the robot link, and those that open its connections
                spaces.outage(seconds, robot=robot_link)

        robot, outside = partial(spaces.start, "robot"), partial(spaces.start, "operator")
        yield _Place(
            folder, robot, outside, outside, OPERATOR_ADDRESS, OPERATOR_ADDRESS, cut, lambda _began, _ended: 0.0
        )


@asynccontextmanager
async def _behind_routers(folder: Path, network: str, seed: int) -> AsyncIterator[_Place]:
    """Each behind a router of its own; the robot's path to the console is that of a profile's robot link."""
    async with ThreeSites(load_profile(network), load_profile("perfect"), HTTP_PORT, seed=seed) as sites:
        robot, console, page = (partial(sites.start, site) for site in SITES)
        cut, silence = partial(sites.outage, "robot"), partial(sites.planned_silence, "robot")
        yield _Place(folder, robot, console, page, "0.0.0.0", CONSOLE, cut, silence)


async def run_cuts(
    way: Way, cuts: int, seconds: float, seed: int, say: Callable[[str], None], *, network: str = "robot-lte"
) -> list[Finding]:
    """Cut the robot's network `cuts` times for `seconds` each; return what the bridge's log tells of each.

    `network`: the profile of the robot's path, for `behind-nat`.

    Raises:
        NamespacesUnavailable: this machine or user cannot have network namespaces.
        ProcessFailed: something did not start.
        TimeoutError: the robot was not driven, or not driven again within a minute.
    """
    with TemporaryDirectory(prefix="lockstep-robot-cuts-") as name:
        folder = Path(name)
        async with (
            _behind_routers(folder, network, seed) if way == "behind-nat" else _on_one_path(folder, seed) as place,
            _driven(place, way),
        ):
            made = [await _cut(place, seconds, number, say) for number in range(cuts)]
        intentions = [tuple(json.loads(line)) for line in place.intentions.read_text().splitlines()]
        log = list(records(place.log))
        found = [_judged(log, cut, intentions) for cut in made]
        return [with_silence(each, cut, place.silence) for each, cut in zip(found, made, strict=True)]


def figures(findings: list[Finding]) -> dict[str, Any]:
    """Return the figures of all cuts: the worst, in ms, and the verdicts."""
    rests = [finding.rest_seconds for finding in findings]
    backs = [finding.control_seconds for finding in findings]
    known_backs = sorted(back for back in backs if back is not None)
    return {
        "cuts": len(findings),
        "rest_ms_worst": _ms(None if None in rests else max(filter(None, rests), default=None)),
        "rest_ms": [_ms(rest) for rest in rests],
        "hold_ms": _ms(DESCRIPTION.hold),
        "back_ms_median": _ms(known_backs[len(known_backs) // 2] if known_backs else None),
        "back_ms_worst": _ms(None if None in backs else known_backs[-1]),
        "back_ms": [_ms(back) for back in backs],
        "own_outage_ms": [_ms(finding.silent_seconds) for finding in findings],
        "oldest_answer_ms": _ms(max(finding.oldest_answer for finding in findings)),
        "oldest_intention_ms": _ms(max(finding.oldest_intention or 0.0 for finding in findings)),
        "max_event_age_ms": _ms(DESCRIPTION.max_event_age),
        "rested_within_hold": sum(finding.rested_within_hold for finding in findings),
        "back_within_2_s": sum(back is not None and back <= RETURN_SECONDS for back in backs),
        "nothing_late": sum(finding.nothing_queued_executed for finding in findings),
    }


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds * 1000, 1)


@asynccontextmanager
async def _driven(place: _Place, way: Way) -> AsyncIterator[None]:
    """Robot, console and operator; yields when the robot is driven."""
    folder = place.folder
    made = self_signed(folder, {place.address}, datetime.datetime.now(datetime.UTC))
    key = folder / "robot.key"
    key.touch(mode=0o600)
    key.write_text(secrets.token_urlsafe(32))
    robot = [
        *(sys.executable, "-m", "lockstep.robot_bridge", "planar", "--json"),
        *("--event-log", str(place.log), "--state-dir", str(folder / "bridge")),
        *("--encode", "h264"),  # raw pictures do not fit every path
    ]
    dials = way != "reached"
    if dials:
        robot += ["--console", f"wss://{place.address}:{HTTP_PORT}", "--console-ca", str(made.chain)]
        robot += ["--console-key-file", str(key)]
    else:
        robot += ["--host", ROBOT_ADDRESS, "--port", str(ROBOT_PORT), "--link-secret-file", str(key)]
    address = "dial-in" if dials else f"tcp://{ROBOT_ADDRESS}:{ROBOT_PORT}"
    console = [
        *(LOCKSTEP, "serve", "--json", "--quiet", "--robot", address, "--link-secret-file", str(key)),
        *("--host", place.host, "--port", str(HTTP_PORT), "--media-port", str(HTTP_PORT)),
        *("--advertise", place.address, "--public-url", f"https://{place.address}:{HTTP_PORT}"),
        *("--tls-cert", str(made.chain), "--tls-key", str(made.key)),
    ]
    settings = {"LOCKSTEP_STATE_DIR": str(folder / "state"), "LOCKSTEP_SCENE": "false"}

    async with (
        started(robot, spawn=place.robot),
        started(console, environment=settings, spawn=place.console) as serving,
    ):
        link = urlsplit(json.loads(await serving.line(r'^\{"console"'))["operator"])
        outside = link._replace(scheme="https", netloc=f"{place.address}:{HTTP_PORT}").geturl()
        operator = [sys.executable, "-m", "lockstep.bench.robot_cuts.operator"]
        operator += [outside, str(made.chain), str(place.intentions)]
        async with started(operator, spawn=place.operator):
            await _until_driven(place.log, time.monotonic())
            yield


async def _cut(place: _Place, seconds: float, number: int, say: Callable[[str], None]) -> Cut:
    await asyncio.sleep(BEFORE)
    began = time.monotonic()
    place.cut(seconds)
    ended = began + seconds
    await asyncio.sleep(seconds)
    driven = await _until_driven(place.log, ended)
    say(f"cut {number + 1}: driven again {driven - ended:.2f} s after the network's return")
    await asyncio.sleep(AFTER)
    return Cut(began, ended, held=False)


async def _until_driven(log: Path, since: float) -> float:
    """Wait until a moving command was executed, by the bridge's log; return when that was."""
    async with asyncio.timeout(PATIENCE):
        place = 0
        while True:
            with contextlib.suppress(FileNotFoundError):
                found, place = await asyncio.to_thread(_read_from, log, place)
                for each in found:
                    if each["kind"] == "executed" and each["time"] >= since and any(each["values"]):
                        return float(each["time"])
            await asyncio.sleep(LOOK)


def _read_from(log: Path, place: int) -> tuple[list[Record], int]:
    """Return the whole lines behind a place of the file, and the next place."""
    with log.open("rb") as lines:
        lines.seek(place)
        data = lines.read()
    whole = data[: data.rfind(b"\n") + 1]
    return [json.loads(line) for line in whole.splitlines()], place + len(whole)


def with_silence(finding: Finding, cut: Cut, silence: Callable[[float, float], float]) -> Finding:
    """Return the finding with the path's own outages. `silence`: s of them between two times."""
    if finding.control_seconds is None:
        return finding
    return replace(finding, silent_seconds=silence(cut.ended, cut.ended + finding.control_seconds))


def _judged(log: list[Record], cut: Cut, intentions: list[Any]) -> Finding:
    """Judge one cut by its own part of the log: up to the first commands that move after the network's return."""
    moved = (each for each in log if each["kind"] == "executed" and each["time"] >= cut.ended and any(each["values"]))
    first = next(moved, None)
    end = cut.ended + PATIENCE if first is None else first["time"] + AFTER
    part = [each for each in log if cut.began - BEFORE_LOG <= each["time"] <= end]
    return judge_outage(
        part,
        cut,
        hold=DESCRIPTION.hold,
        max_event_age=DESCRIPTION.max_event_age,
        intentions=[(at, value) for at, value in intentions if cut.began - BEFORE_LOG <= at <= end],
    )
