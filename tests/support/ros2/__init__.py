"""A ROS 2 robot for tests: a real node in a process of its own, over DDS on loopback."""

import asyncio
import atexit
import fcntl
import hashlib
import os
import platform
import random
import shutil
import socket
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, closing
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from lockstep.bench.harness.processes import Running, running_process
from tests.support.event_logs import whole_lines, written

__all__ = [
    "ACTIONS",
    "EVERYTHING",
    "EXAMPLES",
    "PATIENCE",
    "STAY",
    "TWO_BASES",
    "RosBridge",
    "RosRobot",
    "SERVICES",
    "built_interfaces",
    "have_compiler",
    "have_ros",
    "ros_environment",
    "ros_python",
    "running_ros_bridge",
    "running_ros_robot",
]

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "docs" / "examples" / "ros2"
NODE = Path(__file__).with_name("robot_node.py")
ACTIONS = Path(__file__).with_name("actions_node.py")
EVERYTHING = Path(__file__).with_name("everything_node.py")
BUILD = Path(__file__).with_name("build_interfaces.py")
INTERFACES = Path(__file__).with_name("interfaces")
SERVICES = Path(__file__).with_name("services_node.py")
TWO_BASES = Path(__file__).with_name("two_bases_node.py")
# RTPS well-known ports (DDSI-RTPS 9.6.1.1): 7400 + 250 x domain is where a domain's participants find each other.
DOMAINS = range(1, 100)
FIRST_PORT, PORTS_PER_DOMAIN = 7400, 250
KEPT = 8  # domains that this process keeps to itself: more than run in it at once
PATIENCE = 30.0  # s; DDS takes a while to find everybody on a busy machine
STAY = [0.0, 0.0]


def have_ros() -> bool:
    """Whether there are wheels of ROS 2 for this machine."""
    return (platform.system(), platform.machine()) == ("Linux", "x86_64") and sys.version_info < (3, 14)


def have_compiler() -> bool:
    """Whether interfaces can be built on this machine."""
    return shutil.which("g++") is not None and shutil.which("gcc") is not None


def ros_python() -> str:
    """The interpreter that has ROS 2.

    Raises:
        RuntimeError: it was not installed.
    """
    python = ROOT / ".ros2" / "bin" / "python"
    if not python.exists():
        raise RuntimeError("ROS 2 is not installed for the tests: make test does it")
    return str(python)


_kept: deque[IO[bytes]] = deque()  # the locks of its newest domains


@atexit.register
def _let_go() -> None:
    while _kept:
        _kept.popleft().close()


def built_interfaces() -> Path:
    """Return the directory with the interfaces that the wheels do not have, built when that was not done before.

    It belongs on PYTHONPATH and LD_LIBRARY_PATH. It needs a C++ compiler.
    """
    sources = [BUILD, *sorted(path for path in INTERFACES.rglob("*") if path.is_file())]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    target = ROOT / ".ros2-interfaces" / digest
    target.parent.mkdir(exist_ok=True)
    with (target.parent / "lock").open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not target.exists():
            with tempfile.TemporaryDirectory(dir=target.parent) as work:
                made = Path(work) / "made"
                subprocess.run([ros_python(), str(BUILD), str(made)], check=True, capture_output=True)
                shutil.rmtree(made / "build")
                made.rename(target)
    return target


def ros_environment() -> dict[str, str]:
    """A domain that nobody else uses now, on this machine only."""
    return {
        "ROS_DOMAIN_ID": str(_free_domain()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "PYTHONPATH": os.pathsep.join(str(ROOT / part) for part in (".", "protocol", "robot_bridge")),
    }


def _free_domain() -> int:
    """A domain that nobody uses. It is kept: two processes that choose at once must not choose the same."""
    for domain in random.SystemRandom().sample(DOMAINS, len(DOMAINS)):
        lock = _locked(domain)
        if lock is None:
            continue
        base = FIRST_PORT + PORTS_PER_DOMAIN * domain
        if all(_is_free(base + offset) for offset in (0, 10, 11, 12, 13)):
            _kept.append(lock)
            if len(_kept) > KEPT:
                _kept.popleft().close()
            return domain
        lock.close()
    raise RuntimeError("every ROS domain is in use")


def _locked(domain: int) -> IO[bytes] | None:
    """The lock of a domain, until it is closed; None: another process has it."""
    lock = (Path(tempfile.gettempdir()) / f"lockstep-test-ros-domain-{domain}").open("wb")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        return None
    return lock


def _is_free(port: int) -> bool:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as trial:
        try:
            trial.bind(("", port))
        except OSError:
            return False
        return True


@dataclass
class RosRobot:
    """The running node, and what it has noted: commands that reached it, pictures it took."""

    process: Running
    environment: dict[str, str]  # puts another process on the same topics
    log: Path

    def notes(self, *kinds: str) -> Iterator[dict[str, Any]]:
        return (note for note in whole_lines(self.log) if note["kind"] in kinds)

    async def tell(self, line: str) -> None:
        """`hush /odom`, `speak /odom` …, see robot_node.py. Returns after the robot's next tick."""
        await self.process.ask(line, 20)

    async def noted(self, kind: str, condition: Callable[[list[dict[str, Any]]], bool]) -> list[dict[str, Any]]:
        """Its notes of a kind, once they meet the condition."""
        async with asyncio.timeout(PATIENCE):
            while not condition(notes := list(self.notes(kind))):
                await self.tell("tick")
        return notes

    async def ended_in_one_zero(self, motions: int = 1) -> list[dict[str, Any]]:
        """The commands that reached it, once they ended in a zero, and every motion had one and no second one."""
        await self.noted("twist", lambda twists: _zeros(twists) >= motions and twists[-1]["values"] == STAY)
        for _ in range(5):  # a further word of the bridge would come within two of its repeats, 40 ms
            await self.tell("tick")
        twists = list(self.notes("twist"))
        assert _zeros(twists) == motions
        assert twists[-1]["values"] == STAY
        return twists


def _zeros(twists: list[dict[str, Any]]) -> int:
    return sum(twist["values"] == STAY for twist in twists)


@asynccontextmanager
async def running_ros_robot(
    directory: Path, node: Path = NODE, *, interfaces: Path | None = None
) -> AsyncIterator[RosRobot]:
    """`interfaces`: a directory of `built_interfaces`, for the node and for a bridge beside it."""
    log = directory / "robot_node.jsonl"
    environment = ros_environment()
    if interfaces is not None:
        environment["PYTHONPATH"] += f"{os.pathsep}{interfaces}"
        environment["LD_LIBRARY_PATH"] = str(interfaces)
    async with running_process(ros_python(), str(node), str(log), environment=environment) as (process, _):
        yield RosRobot(process, environment, log)


@dataclass
class RosBridge:
    """A running `lockstep robot --ros2`."""

    process: Running
    address: tuple[str, int]
    event_log: Path

    async def records(self, kind: str) -> list[dict[str, Any]]:
        """What it has recorded of one kind until this call; it has to run."""
        return [record for record in await written(self.event_log) if record["kind"] == kind]


@asynccontextmanager
async def running_ros_bridge(directory: Path, robot: RosRobot, settings: Path) -> AsyncIterator[RosBridge]:
    """In the environment of the robot's ROS installation, which has nothing of the console's."""
    event_log = directory / "bridge.jsonl"
    command = (ros_python(), "-m", "lockstep.robot_bridge", "--ros2", str(settings), "--port", "0", "--json")
    state = ("--state-dir", str(directory / "bridge-state"))
    async with running_process(*command, *state, "--event-log", str(event_log), environment=robot.environment) as (
        process,
        ready,
    ):
        host, _, port = ready["robot"].removeprefix("tcp://").rpartition(":")
        yield RosBridge(process, (host, int(port)), event_log)
