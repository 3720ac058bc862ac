"""Runs one experiment: a robot, a console, a network, an operator who drives, and watchers."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from typing import Protocol

from lockstep.bench.experiment.choices import Choices, media_of
from lockstep.bench.experiment.headless import headless_client
from lockstep.bench.experiment.judge.record import ClientRecord, Run
from lockstep.bench.experiment.judge.robot_log import read_robot_log
from lockstep.bench.experiment.operator_script import OperatorScript
from lockstep.bench.experiment.stage import Stage, running_stage
from lockstep.emulator.impairment.profile import Profile
from lockstep.protocol.description import RobotDescription

__all__ = ["RunningClient", "run_experiment"]

Say = Callable[[str], None]

START_SECONDS = 45.0  # until every client has a picture
LOG_DELAY = 0.4  # s until the bridge's log is on disk


class RunningClient(Protocol):
    """The methods of a client that a run needs, with or without a browser."""

    record: ClientRecord

    @property
    def description(self) -> RobotDescription: ...
    async def take_seat(self) -> None: ...
    async def until_picture(self) -> None: ...
    def observed(self) -> AbstractAsyncContextManager[None]: ...
    async def drive(self, script: OperatorScript, seconds: float) -> None: ...
    async def rest(self) -> None: ...


async def run_experiment(choices: Choices, profile: Profile, say: Say) -> Run:
    """Run one experiment.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: the run failed.
    """
    async with (
        running_stage(choices.robot, profile, media_of(profile, choices.adapts), choices.seed) as stage,
        _clients(stage, choices) as clients,
    ):
        operator = clients[0]
        async with asyncio.timeout(START_SECONDS):
            await operator.take_seat()
            await asyncio.gather(*(client.until_picture() for client in clients))
        say(f"{choices.profile}, {choices.mode}: driving for {choices.seconds:g} s")
        return await _drive(stage, choices, clients)


async def _drive(stage: Stage, choices: Choices, clients: list[RunningClient]) -> Run:
    operator = clients[0]
    description = operator.description
    script = OperatorScript(description.axes, choices.seed)
    async with AsyncExitStack() as observing:
        for client in clients:
            await observing.enter_async_context(client.observed())
        stage.network.begin()
        began = time.monotonic()
        await operator.drive(script, choices.seconds)
        ended = time.monotonic()
    statistics = stage.network.statistics().fields()
    await asyncio.sleep(LOG_DELAY)
    return Run(
        began=began,
        ended=ended,
        robot=read_robot_log(stage.event_log, began, ended),
        clients=[client.record for client in clients],
        cameras=[camera.name for camera in description.cameras],
        microphones=[microphone.name for microphone in description.microphones],
        network=statistics,
    )


@asynccontextmanager
async def _clients(stage: Stage, choices: Choices) -> AsyncIterator[list[RunningClient]]:
    """Connect the clients, the operator first. They connect in turn, so that a seed gives each the same network."""
    async with AsyncExitStack() as stack:
        if choices.browser:
            from lockstep.bench.experiment.browser import (
                browser_client,  # needs Playwright, which only the tests install
            )

            operator: RunningClient = await stack.enter_async_context(browser_client(stage.link, choices))
        else:
            operator = await stack.enter_async_context(
                headless_client(stage.link, choices, "operator", choices.gate, choices.pacing, drives=True)
            )
        clients = [operator]
        for gate in choices.watching:
            watcher = headless_client(stage.link, choices, f"watcher-{gate}", gate, "feedback", drives=False)
            clients.append(await stack.enter_async_context(watcher))
        yield clients
