"""One robot in a network namespace of its own, which is cut in mid-drive: the console and the operator are outside.

Linux and root only. The cut loses every packet of the robot. What happened is told by the bridge's own log.
"""

import datetime
import json
import secrets
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal
from urllib.parse import urlsplit

from lockstep.bench.experiment.judge.outage_judge import Finding
from lockstep.bench.harness.event_log import records
from lockstep.bench.harness.processes import Spawn, started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.bench.robot_cuts.cuts import cut_once, judged, until_driven
from lockstep.emulator import load_profile
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.profile import even_profile
from lockstep.emulator.namespace.namespaces import OPERATOR_ADDRESS, ROBOT_ADDRESS, Namespaces
from lockstep.emulator.namespace.three_sites import CONSOLE, SITES, ThreeSites
from lockstep.server.http.transport.tls import self_signed

__all__ = ["Way", "run_cuts"]

# The console connects to the robot, the robot to the console, or that with each of robot, console and operator behind a
# router of its own.
Way = Literal["reached", "dial-in", "behind-nat"]

HTTP_PORT, ROBOT_PORT = 8000, 5600
ONE_WAY = 0.02  # s


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
            made = [await cut_once(place.log, place.cut, seconds, number, say) for number in range(cuts)]
        lines = place.intentions.read_text().splitlines()
        intentions: list[tuple[float, float]] = [(at, value) for at, value in map(json.loads, lines)]
        return judged(list(records(place.log)), made, place.silence, intentions)


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
            await until_driven(place.log, time.monotonic())
            yield
