"""Cuts the network in mid-drive: measures the robot's motion, and the time until the operator drives again."""

import asyncio
import contextlib
import itertools
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any, Protocol

from lockstep.bench.experiment.choices import Choices, media_of, round_trip_of
from lockstep.bench.experiment.judge.outage_judge import Cut, Finding, judge_outage
from lockstep.bench.experiment.stage import Stage, running_stage
from lockstep.bench.harness.driving import applied_goals, axis_values, drive_on
from lockstep.bench.harness.event_log import records
from lockstep.client import CommandRefused, Console, ConsoleError
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.profile import Profile, TwoWay
from lockstep.protocol.description import RobotDescription
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["OUTAGE_PROFILE", "run_outages"]

ONE_WAY = Impairment(delay=Constant(0.02))
PATH = TwoWay(ONE_WAY, ONE_WAY)
OUTAGE_PROFILE = Profile("outage", "40 ms round trip, cut on demand", media=PATH, control=PATH, signalling=PATH)

BEFORE = 1.5  # s of driving before each cut
AFTER = 0.5  # s of driving after control returned
PATIENCE = 20.0  # s to wait for control to return
STEP = 0.05  # s between two intentions
MARK = 1e-5  # by which each intention differs from the one before
LOG_DELAY = 0.4
RETURN_SECONDS = 2.0


class Stick(Protocol):
    """An operator who always holds the stick, and takes control again as soon as possible."""

    intentions: list[tuple[float, float]]  # (time, value of the first axis); empty if all are the same


async def run_outages(
    choices: Choices, profile: Profile, say: Callable[[str], None], ways: Sequence[bool] = (False, True)
) -> dict[str, Any]:
    """Run an outage for each of `ways`: True if packets wait in the network, False if they are lost.

    Raises:
        ProcessFailed: the stage did not start.
    """
    found = []
    round_trip = round_trip_of(profile)
    async with running_stage(choices.robot, profile, media_of(profile), choices.seed) as stage:
        for held in ways:
            say(f"outage of {choices.seconds:g} s, packets {'wait in the network' if held else 'are lost'}")
            cut, stick, description = await _cut(stage, choices, held)
            finding = judge_outage(
                records(stage.event_log),
                cut,
                hold=description.hold,
                max_event_age=description.max_event_age,
                intentions=stick.intentions,
            )
            found.append(_said(finding, held, round_trip))
    return {
        "experiment": "outage",
        "network": profile.name,
        "round_trip_ms": round(round_trip * 1000, 1),
        "seconds": choices.seconds,
        "robot": choices.robot,
        "client": "chromium" if choices.browser else "headless",
        "seed": choices.seed,
        "outages": found,
        "verdicts": {
            "rested_within_hold": all(each["rested_within_hold"] for each in found),
            "nothing_queued_executed": all(each["nothing_queued_executed"] for each in found),
            "control_within_2_s": all(each["control_within_2_s"] for each in found),
        },
    }


def _said(finding: Finding, held: bool, round_trip: float) -> dict[str, Any]:
    def ms(seconds: float | None) -> float | None:
        return None if seconds is None else round(seconds * 1000, 1)

    control = finding.control_seconds
    return {
        "packets": "held" if held else "lost",
        "rest_ms": ms(finding.rest_seconds),
        "hold_ms": ms(finding.hold),
        "oldest_answer_ms": ms(finding.oldest_answer),
        "oldest_intention_ms": ms(finding.oldest_intention),
        "max_event_age_ms": ms(finding.max_event_age),
        "control_ms": ms(control),
        "control_round_trips": None if control is None or not round_trip else round(control / round_trip, 1),
        "rested_within_hold": finding.rested_within_hold,
        "nothing_queued_executed": finding.nothing_queued_executed,
        "control_within_2_s": control is not None and control <= RETURN_SECONDS,
    }


async def _cut(stage: Stage, choices: Choices, held: bool) -> tuple[Cut, Stick, RobotDescription]:
    async with _stick(stage, choices) as (stick, description):
        async with asyncio.timeout(PATIENCE):
            await _until_driven(stage, time.monotonic())
        await asyncio.sleep(BEFORE)
        began = time.monotonic()
        stage.network.outage(choices.seconds, hold=held)
        ended = began + choices.seconds
        await asyncio.sleep(choices.seconds)
        with contextlib.suppress(TimeoutError):  # the judge reports it
            async with asyncio.timeout(PATIENCE):
                await _until_driven(stage, ended)
        await asyncio.sleep(AFTER)
    await asyncio.sleep(LOG_DELAY)
    return Cut(began, ended, held), stick, description


async def _until_driven(stage: Stage, since: float) -> None:
    """Wait until a moving command was executed, by the bridge's log; returns a little later."""
    while True:
        found = await asyncio.to_thread(lambda: list(records(stage.event_log)))
        if any(each["kind"] == "executed" and each["time"] >= since and any(each["values"]) for each in found):
            return
        await asyncio.sleep(0.2)


@asynccontextmanager
async def _stick(stage: Stage, choices: Choices) -> AsyncIterator[tuple[Stick, RobotDescription]]:
    if choices.browser:
        from lockstep.bench.experiment.browser_stick import (
            browser_stick,  # needs Playwright, which only the tests install
        )

        async with browser_stick(stage.link) as (page, description):
            yield page, description
        return
    stick = HeadlessStick(stage.link, choices.seconds)
    description = await stick.describe()
    async with background_tasks(stick.run()):
        yield stick, description


class HeadlessStick:
    """Makes each intention differ a little from the last, so that the log tells when an executed one was formed."""

    def __init__(self, link: str, outage: float) -> None:
        self.intentions: list[tuple[float, float]] = []
        self._link = link
        self._silence = outage + 5.0  # the connection should survive
        self._marks = itertools.count(1)

    async def describe(self) -> RobotDescription:
        async with Console(self._link, video=False, audio=False) as console:
            return console.description

    async def run(self) -> None:
        while True:
            with contextlib.suppress(ConsoleError):
                async with Console(
                    self._link, video=False, audio=False, silence_seconds=self._silence, name="operator"
                ) as console:
                    await self._hold(console)
            await asyncio.sleep(STEP)

    async def _hold(self, console: Console) -> None:
        await console.take_seat()
        first, goals = console.description.axes[0], applied_goals(console)
        base = 0.2 if first.kind == "rate" or not goals else goals[0] or 0.0  # a goal axis hardly moves from its place
        while True:
            formed = time.monotonic()
            value = base + next(self._marks) * MARK
            self.intentions.append((formed, value))
            try:
                async with asyncio.timeout(STEP):
                    values = axis_values(console.description.axes, {-1: 0.8})
                    values[0] = value
                    await drive_on(console, values)
            except TimeoutError:
                continue  # in flight; the next intention takes its place
            except CommandRefused as refused:
                if refused.reason != "no_seat":
                    raise
                await console.take_seat()
            await asyncio.sleep(max(0.0, formed + STEP - time.monotonic()))
