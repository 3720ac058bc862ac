"""Measures the gap without a gate: it grows without a bound with the event rate and with the delay of the pictures.

A client beside the robot drives at a fixed rate. Viewers look on through the profile's network (the robot's own link is
short here); each player adds its own delay, as the players of the thesis did (its audio tool: up to 2 s).
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import asdict, dataclass, replace
from typing import Any

from lockstep.bench.experiment.choices import Choices, MediaChoice
from lockstep.bench.experiment.headless import HeadlessClient, headless_client
from lockstep.bench.experiment.judge.age_gate import count_by_age
from lockstep.bench.experiment.judge.measures import event_rate
from lockstep.bench.experiment.judge.record import ClientRecord, Gate
from lockstep.bench.experiment.stage import Stage, running_stage
from lockstep.bench.harness.driving import axis_values, drive_on
from lockstep.client import Console
from lockstep.emulator.impairment.delay import Delay
from lockstep.emulator.impairment.profile import Profile, TwoWay
from lockstep.emulator.namespace.network_process import NetworkProcess

__all__ = ["Growth", "Point", "later", "run_growth"]

RATES = (2.0, 5.0, 10.0, 20.0)  # events a second
DELAYS = (0.0, 0.25, 1.0, 2.0)  # s that a player adds
# Every player is watched without a gate; the gates with the players that are hardest for them.
VIEWERS: tuple[tuple[Gate, float], ...] = (
    *(("off", delay) for delay in DELAYS),
    ("age", 0.0),
    ("age", 0.25),
    ("event", 0.0),
    ("event", 0.25),
    ("event", 2.0),
)
MEDIA = MediaChoice(400, 10.0, "PCMU", 2)  # nine viewers have to be decoded on this machine
COUNTS = ("received", "rendered", "violations")
SETTLE = 3.0  # s for a new rate to reach the slowest player


@dataclass(frozen=True)
class Point:
    gate: Gate
    delay: float
    event_rate: float
    received: int
    rendered: int
    max_gap: int
    violations: int


@dataclass(frozen=True)
class Growth:
    profile: str
    tolerance: int
    delays: Sequence[float]
    points: list[Point]

    def fields(self) -> dict[str, Any]:
        """Return the fields for JSON."""
        events = [point for point in self.points if point.gate == "event"]
        return {
            "experiment": "growth",
            "profile": self.profile,
            "tolerance": self.tolerance,
            "points": [asdict(point) for point in self.points],
            "verdicts": {"no_violation": not any(point.violations for point in events)},
        }


@dataclass(frozen=True)
class Later:
    """A delay distribution with a constant added."""

    usual: Delay
    more: float

    @property
    def mean(self) -> float:
        return self.usual.mean + self.more

    @property
    def max(self) -> float:
        return self.usual.max + self.more

    def quantile(self, share: float) -> float:
        return self.usual.quantile(share) + self.more


def later(profile: Profile, seconds: float) -> Profile:
    """Return the profile with media that come later by `seconds`."""
    towards = replace(profile.media.to_operator, delay=Later(profile.media.to_operator.delay, seconds))
    return replace(profile, media=TwoWay(towards, profile.media.to_robot))


async def run_growth(
    choices: Choices,
    profile: Profile,
    say: Callable[[str], None],
    *,
    rates: Sequence[float] = RATES,
    viewers: Sequence[tuple[Gate, float]] = VIEWERS,
) -> Growth:
    """Drive for `choices.seconds` at each event rate.

    Args:
        viewers: each one's gate, and the seconds that its player adds

    Raises:
        ProcessFailed, ConsoleError: the run failed.
    """
    points: list[Point] = []
    async with (
        running_stage(choices.robot, profile, MEDIA, choices.seed, robot_link=False) as stage,
        Console(stage.near_link, video=False, audio=False, name="operator") as operator,
        _viewers(stage, choices, profile, viewers) as watching,
    ):
        await operator.take_seat()
        async with asyncio.timeout(60):
            await asyncio.gather(*(viewer.until_picture() for _, viewer in watching))
        for rate in rates:
            say(f"{profile.name}, growth: {rate:g} events a second for {choices.seconds:g} s")
            await _drive(operator, rate, SETTLE)
            async with AsyncExitStack() as observing:
                for _, viewer in watching:
                    viewer.record = _anew(viewer.record)
                    await observing.enter_async_context(viewer.observed())
                await _drive(operator, rate, choices.seconds)
            points += [_point(delay, viewer) for delay, viewer in watching]
    return Growth(profile.name, choices.tolerance, DELAYS, points)


async def _drive(operator: Console, rate: float, seconds: float) -> None:
    values = axis_values(operator.description.axes, {0: 0.2, -1: 0.8})
    end = time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        await drive_on(operator, values)
        await asyncio.sleep(max(0.0, now + 1 / rate - time.monotonic()))


@asynccontextmanager
async def _viewers(
    stage: Stage, choices: Choices, profile: Profile, chosen: Sequence[tuple[Gate, float]]
) -> AsyncIterator[list[tuple[float, HeadlessClient]]]:
    async with AsyncExitStack() as stack:
        viewers = []
        for number, (gate, delay) in enumerate(chosen):
            url = stage.near_link.partition("/#")[0]
            network = NetworkProcess(later(profile, delay), console_url=url, seed=choices.seed + number)
            entered = await stack.enter_async_context(network)
            client = headless_client(
                entered.link(stage.near_link), choices, f"{gate} +{delay:g} s", gate, "feedback", drives=False
            )
            viewers.append((delay, await stack.enter_async_context(client)))
        yield viewers


def _anew(record: ClientRecord) -> ClientRecord:
    return ClientRecord(record.name, record.kind, record.gate, record.pacing, record.drives, record.tolerance)


def _point(delay: float, viewer: HeadlessClient) -> Point:
    record, camera = viewer.record, viewer.description.cameras[0].name
    before, after = (
        next(each for each in said["streams"] if each["stream"] == camera)
        for said in (record.statistics_before, record.statistics)
    )
    counts = count_by_age(record, camera, {name: after[name] - before[name] for name in COUNTS})
    gaps = [abs(each.gap) for each in record.since_begin(camera) if each.gap is not None]
    return Point(
        gate=record.gate,
        delay=delay,
        event_rate=round(event_rate(record.feedbacks), 2),
        received=counts["received"],
        rendered=counts["rendered"],
        max_gap=max(gaps, default=0),
        violations=counts["violations"],
    )
