"""Starts, connects and ends the robot, console and network of one run."""

import secrets
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from lockstep.bench.emulator.impairment.profile import Profile
from lockstep.bench.emulator.namespace.network_process import NetworkProcess
from lockstep.bench.experiment.choices import MediaChoice
from lockstep.bench.harness.processes import Running, running_process

__all__ = ["Stage", "running_stage"]


@dataclass(frozen=True)
class Stage:
    network: NetworkProcess
    bridge: Running
    console: Running
    event_log: Path
    near_link: str  # an operator's link, past the network, from beside the console

    @property
    def link(self) -> str:
        """An operator's link through the network."""
        return self.network.link(self.near_link)


@asynccontextmanager
async def running_stage(
    robot: str, profile: Profile, media: MediaChoice, seed: int, *, robot_link: bool = True
) -> AsyncIterator[Stage]:
    """Start the stage. `robot_link`: whether the robot's link passes the network too.

    Raises:
        ProcessFailed: a process did not start.
    """
    lockstep = str(Path(sys.executable).with_name("lockstep"))
    with TemporaryDirectory(prefix="lockstep-experiment-") as directory:
        log = Path(directory) / "events.jsonl"
        environment = {
            **media.environment(),
            "LOCKSTEP_STATE_DIR": directory,
            "LOCKSTEP_SECRET": secrets.token_urlsafe(32),
            "LOCKSTEP_SCENE": "false",
        }
        robot_command = (lockstep, "robot", robot, "--port", "0", "--event-log", str(log), "--event-strip", "--json")
        state = ("--state-dir", str(Path(directory) / "bridge"))
        async with running_process(*robot_command, *state) as (bridge, ready):
            host, _, port = ready["robot"].removeprefix("tcp://").rpartition(":")
            async with NetworkProcess(profile, robot=(host, int(port)) if robot_link else None, seed=seed) as network:
                address = network.robot_address or ready["robot"]
                serve = (lockstep, "serve", "--robot", address, "--port", "0", "--json", "--quiet")
                async with running_process(*serve, environment=environment) as (console, links):
                    await network.open_console(links["console"])
                    yield Stage(network, bridge, console, log, links["operator"])
