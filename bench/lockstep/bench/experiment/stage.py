"""Starts, connects and ends the robot, console and network of one run."""

import secrets
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from lockstep.bench.experiment.choices import MediaChoice
from lockstep.bench.harness.processes import Running
from lockstep.bench.harness.stack import running_bridge, running_console
from lockstep.emulator.impairment.profile import Profile
from lockstep.emulator.namespace.network_process import NetworkProcess

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
    robot: str,
    profile: Profile,
    media: MediaChoice,
    seed: int,
    *,
    robot_link: bool = True,
    settings: Mapping[str, str] | None = None,
) -> AsyncIterator[Stage]:
    """Start the stage.

    `robot_link`: whether the robot's link passes the network too. `settings`: more of the console, LOCKSTEP_…

    Raises:
        ProcessFailed: a process did not start.
    """
    async with running_bridge(robot) as bridge:
        environment = {
            **media.environment(),
            "LOCKSTEP_STATE_DIR": str(bridge.event_log.parent),
            "LOCKSTEP_SECRET": secrets.token_urlsafe(32),
            "LOCKSTEP_SCENE": "false",
            **(settings or {}),
        }
        through = ("127.0.0.1", bridge.port) if robot_link else None
        async with NetworkProcess(profile, robot=through, seed=seed) as network:
            address = network.robot_address or bridge.address
            async with running_console(address, environment=environment) as (console, links):
                await network.open_console(links["console"])
                yield Stage(network, bridge.process, console, bridge.event_log, links["operator"])
