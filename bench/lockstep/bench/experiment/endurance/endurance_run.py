"""Runs `lockstep experiment endurance`: an operator drives over one network for any time."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, Literal, Protocol

import httpx
import msgspec

from lockstep.bench.experiment.choices import Choices, media_of
from lockstep.bench.experiment.endurance.endurance import Endurance
from lockstep.bench.experiment.operator_script import OperatorScript
from lockstep.bench.experiment.stage import Stage, running_stage
from lockstep.bench.harness.driving import applied_goals, drive_on
from lockstep.bench.harness.stack import Metrics
from lockstep.client import CommandRefused, Console, ConsoleError, NoSuchStream
from lockstep.emulator.impairment.profile import Profile
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["Driven", "EnduranceClient", "run_endurance"]

EnduranceClient = Literal["headless", "chromium", "firefox"]
Say = Callable[[str], None]

LIVE_SECONDS = 90.0  # until the first picture
COUNT_SECONDS = 1.0  # between two looks at the console's counters
NEWS_SECONDS = 60.0
RETRY_SECONDS = 0.5
LOOK_SECONDS = 0.25
SILENCE_SECONDS = 30.0  # until a headless client takes its console for lost: never before the connection itself


class Driven(Protocol):
    """A client with an operator."""

    async def until_live(self) -> None:
        """Wait until a picture was rendered."""

    async def run(self, endurance: Endurance, clock: Callable[[], float]) -> None:
        """Drive and watch until cancelled. `clock`: returns s since the run began."""


async def run_endurance(choices: Choices, profile: Profile, client: EnduranceClient, say: Say) -> dict[str, Any]:
    """Drive for `choices.seconds` over `profile`, and return what became of the connections.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: the run did not begin.
    """
    endurance = Endurance(profile.client_outages)
    async with (
        running_stage(choices.robot, profile, media_of(profile, choices.adapts), choices.seed) as stage,
        _driven(client, stage, choices) as driven,
    ):
        async with asyncio.timeout(LIVE_SECONDS):
            await driven.until_live()
        stage.network.begin()
        began = time.monotonic()

        def clock() -> float:
            return time.monotonic() - began

        say(f"endurance on {profile.name}, {client}: driving for {choices.seconds:g} s")
        async with background_tasks(driven.run(endurance, clock), _count(stage, endurance, clock, say)):
            await asyncio.sleep(choices.seconds)
    return {
        "experiment": "endurance",
        "profile": profile.name,
        "client": client,
        "seconds": round(clock()),
        "seed": choices.seed,
        **endurance.fields(),
    }


async def _count(stage: Stage, endurance: Endurance, clock: Callable[[], float], say: Say) -> None:
    """Read the console's counts of connections that ended, past the network."""
    url = stage.near_link.partition("/#")[0]
    news_at = NEWS_SECONDS
    async with httpx.AsyncClient(base_url=url, trust_env=False) as http:
        while True:
            with contextlib.suppress(httpx.HTTPError):
                text = (await http.get("/metrics")).raise_for_status().text
                counters = Metrics(text)
                endurance.refused = counters.values("lockstep_bad_input_total", "reason", where="transport")
                for lost in endurance.ended(clock(), counters.values("lockstep_peers_ended_total", "why")):
                    say(f"{lost.at:7.1f} s  a connection ended: {lost.why}")
            if clock() > news_at:
                news_at += NEWS_SECONDS
                found = endurance.fields()
                say(f"{clock():7.1f} s  " + ", ".join(f"{found[name]} {name}" for name in ("pictures", "violations")))
            await asyncio.sleep(COUNT_SECONDS)


@asynccontextmanager
async def _driven(client: EnduranceClient, stage: Stage, choices: Choices) -> AsyncIterator[Driven]:
    if client == "headless":
        yield HeadlessHands(stage.link, choices)
        return
    from lockstep.bench.experiment.endurance.endurance_page import (
        driven_page,  # needs browsers, which only the tests install
    )

    async with driven_page(client, stage.link, choices) as page:
        yield page


class HeadlessHands:
    """Drives by the script, and connects again when the connection ends."""

    def __init__(self, link: str, choices: Choices, *, relay_only: bool = False) -> None:
        self._link = link
        self._relay_only = relay_only
        self._choices = choices
        self._console: Console | None = None

    async def until_live(self) -> None:
        """Return at once, because this client has no window to open: its first connection belongs to the run."""

    async def run(self, endurance: Endurance, clock: Callable[[], float]) -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(self._look(endurance, clock))
            while True:
                try:
                    await self._live(clock)
                except* ConsoleError:
                    self._console = None

    async def _live(self, clock: Callable[[], float]) -> None:
        """Drive over one connection until it is lost."""
        async with Console(
            self._link,
            tolerance=self._choices.tolerance,
            audio_tolerance=self._choices.tolerance,
            name="operator",
            silence_seconds=SILENCE_SECONDS,
            connect_seconds=LIVE_SECONDS,
            relay_only=self._relay_only,
        ) as console:
            self._console = console
            async with asyncio.TaskGroup() as group:
                group.create_task(_watch(console))
                for microphone in console.description.microphones:
                    group.create_task(_listen(console, microphone.name))
                await self._drive(console, clock)

    async def _drive(self, console: Console, clock: Callable[[], float]) -> None:
        script = OperatorScript(console.description.axes, self._choices.seed)
        while True:
            try:
                await console.take_seat()
                while True:
                    move = script.at(clock(), applied_goals(console))
                    await drive_on(console, move.values)
                    await asyncio.sleep(move.interval)
            except CommandRefused:
                await asyncio.sleep(RETRY_SECONDS)

    async def _look(self, endurance: Endurance, clock: Callable[[], float]) -> None:
        while True:
            console = self._console
            if console is None:
                endurance.look(clock(), live=False, mine=False, driving=False, streams={})
            else:
                with contextlib.suppress(ConsoleError):
                    _look_at(console, endurance, clock())
            await asyncio.sleep(LOOK_SECONDS)


async def _watch(console: Console) -> None:
    """Take the pictures, which a client has to do."""
    async for _ in console.pictures(console.description.cameras[0].name):
        pass


async def _listen(console: Console, microphone: str) -> None:
    with contextlib.suppress(NoSuchStream):
        async for _ in console.sounds(microphone):
            pass


def _look_at(console: Console, endurance: Endurance, at: float) -> None:
    found = console.stats()
    mine = console.seat.holder == console.peer
    streams = {each.stream: msgspec.to_builtins(each) for each in found.streams}
    endurance.look(at, live=True, mine=mine, driving=mine and found.armed, streams=streams)
