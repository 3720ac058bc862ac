"""Measures 50, 100 and 200 observers besides one operator: missed pictures, the cost of each, and the operator's delay.

The observers are headless clients in a separate process; they receive all cameras and the sound, count RTP and decode
nothing. Their processes run when no other process wants to: real observers have their own machines. The operator drives
from a third process, before they come, while they are there and after they have left: the machine's own speed changes
within a minute.

Pictures: at both ends of the spell the bridge is held still for a moment, so that nothing is on its way while the
pictures are counted, at the console's encoders and at each observer. Missed are the pictures that the console dropped
because a queue was full, and those lost on the way, by the gaps in RTP's numbers. Observers that were in one tier
(docs/quality.md) all the time show that nothing else is missing: they have exactly as many pictures as its encoder
made. The number of observers whose count is no tier's is reported: their path looked full for a part of the spell, so
that they got other pictures meanwhile, or they missed some.

Cost: processor time of the console's process (proc(5)) with the observers less that without, divided by their number.
The baseline is the main camera alone on `bench.baseline_server`: aiortc encodes it for each peer.
"""

import asyncio
import sys
import time
from dataclasses import dataclass

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.driving import console_trips
from lockstep.bench.harness.processes import Running, running_process
from lockstep.bench.harness.stack import Bridge, Metrics, Stack, running_stack
from lockstep.bench.viewers.idle_crowd import idle_crowd
from lockstep.client import Console

__all__ = ["run"]

SECTION = "observers"
CROWDS, QUICK_CROWDS = (50, 100, 200), (10,)
EVENTS, QUICK_EVENTS = 400, 60
BARE_PEERS = 8
BARE_SECONDS, QUICK_BARE_SECONDS = 8, 3
ANSWER_SECONDS = 10.0
SETTLE = 3.0  # s after an observer came or left
CALM, QUICK_CALM = 20, 2  # s until the effect of hundreds of handshakes on the crowd's pictures is over
ENCODE = 0.03  # s until the bridge's pictures are encoded
LOOK, SAME, LOOKS = 0.01, 3, 40  # s between two looks at the observers; looks alike that settle it; looks at most
ROBOT = "planar"  # the lightest: the machine's cores are for the console and the observers
CPU_TARGET = 0.25  # % of a core for each
SLOWDOWN_TARGETS = {100: 1.1, 200: 1.1}
TIERS = ("operator", "high", "crowd", "low")
CORE = 100.0  # %: the most that two hundred may use

Received = dict[str, list[int]]  # per stream: frames, and packets lost


@dataclass(frozen=True)
class Spell:
    """The figures of a spell in which the operator drives."""

    trips: list[float]  # ms
    console_cpu: float  # share of a core, in %
    audience_cpu: float


@dataclass(frozen=True)
class Counts:
    """Counts taken while the bridge is held still."""

    taken: dict[str, int]  # pictures that were encoded, by camera, each once for however many tiers
    tiers: dict[str, dict[str, int]]  # encoded pictures of each tier, by camera
    dropped: int  # pictures that did not fit an observer's queue
    received: list[Received]  # by observer


@dataclass(frozen=True)
class Missed:
    """The pictures missed between two counts, of all observers together."""

    received: int  # pictures
    dropped: int  # at the console
    lost: int  # packets on the way
    mixed: int  # observers whose number of pictures is no tier's

    @property
    def percent(self) -> float:
        """The share of the pictures meant for an observer, in %."""
        missed = self.dropped + self.lost
        return 100 * missed / (self.received + missed)


@dataclass(frozen=True)
class Watched:
    """The measurements of one crowd."""

    count: int
    alone: Spell
    watched: Spell
    before: Counts
    after: Counts


async def run(context: Context) -> list[Result]:
    events = context.scale(EVENTS, QUICK_EVENTS)
    results: list[Result] = []
    async with running_stack(ROBOT) as stack:
        bare = await _bare(stack.bridge, context.scale(BARE_SECONDS, QUICK_BARE_SECONDS))
        for count in QUICK_CROWDS if context.quick else CROWDS:
            async with Console(stack.operator, name="operator", decode=False) as operator:
                results += _results(await _watched_by(count, stack, operator, events, context), bare)
    return results


async def _watched_by(count: int, stack: Stack, operator: Console, events: int, context: Context) -> Watched:
    await operator.take_seat()
    await asyncio.sleep(SETTLE)
    before_them = await _drive(stack, [], operator, events)
    async with idle_crowd(stack.observer, count, context) as audiences:
        await asyncio.sleep(context.scale(CALM, QUICK_CALM))
        before = await _count(stack, audiences)
        await asyncio.sleep(SETTLE)
        watched = await _drive(stack, audiences, operator, events)
        after = await _count(stack, audiences)
    await asyncio.sleep(SETTLE)
    after_them = await _drive(stack, [], operator, events)
    alone = Spell([*before_them.trips, *after_them.trips], (before_them.console_cpu + after_them.console_cpu) / 2, 0.0)
    return Watched(count, alone, watched, before, after)


async def _drive(stack: Stack, audiences: list[Running], operator: Console, events: int) -> Spell:
    processes = [stack.console, *audiences]
    began, used = time.monotonic(), [process.usage.cpu_seconds() for process in processes]
    trips = await console_trips(operator, events)
    seconds = time.monotonic() - began
    shares = [
        (process.usage.cpu_seconds() - before) / seconds * 100 for process, before in zip(processes, used, strict=True)
    ]
    await operator.rest()
    return Spell([trip.seconds * 1000 for trip in trips], shares[0], sum(shares[1:]))


async def _count(stack: Stack, audiences: list[Running]) -> Counts:
    """Count with the bridge held still, only for as long as that takes."""
    stack.bridge.process.pause()
    try:
        await asyncio.sleep(ENCODE)
        metrics, received = await asyncio.gather(stack.metrics(), _settled(audiences))
    finally:
        stack.bridge.process.go_on()
    return counts_from(metrics, received)


def counts_from(metrics: Metrics, received: list[Received]) -> Counts:
    """Return the console's counts of its pictures, without sound."""
    taken = metrics.values("lockstep_media_pictures_taken_total", "stream")

    def of_cameras(name: str, **where: str) -> dict[str, int]:
        values = metrics.values(name, "stream", **where)
        return {stream: int(count) for stream, count in values.items() if stream in taken}

    tiers = {tier: of_cameras("lockstep_media_tier_frames_encoded_total", tier=tier) for tier in TIERS}
    dropped = of_cameras("lockstep_media_frames_dropped_total", stage="peer_busy")
    return Counts(of_cameras("lockstep_media_pictures_taken_total"), tiers, sum(dropped.values()), received)


async def _settled(audiences: list[Running]) -> list[Received]:
    """Return the counts of each observer once no more pictures come."""
    found: list[list[Received]] = []
    while len(found) < SAME or any(each != found[-1] for each in found[-SAME:]):
        if len(found) > LOOKS:
            raise RuntimeError("the observers' counts grow without a picture")
        answers = await asyncio.gather(*(audience.ask("count", ANSWER_SECONDS) for audience in audiences))
        found.append([counts for answer in answers for counts in answer["counts"]])
        await asyncio.sleep(LOOK)
    return found[-1]


async def _bare(bridge: Bridge, seconds: float) -> dict[int, float]:
    """Return the processor time per peer in % of a core, by number of peers."""
    async with running_process(sys.executable, "-m", "lockstep.bench.baseline.baseline_server", bridge.address) as (
        server,
        ready,
    ):
        nobody = await _share(server, seconds)
        found: dict[int, float] = {}
        for peers in (1, BARE_PEERS):
            command = (sys.executable, "-m", "lockstep.bench.viewers.audience", ready["console"], str(peers), "plain")
            async with running_process(*command):
                await asyncio.sleep(SETTLE)
                found[peers] = (await _share(server, seconds) - nobody) / peers
        return found


async def _share(process: Running, seconds: float) -> float:
    before, began = process.usage.cpu_seconds(), time.monotonic()
    await asyncio.sleep(seconds)
    return (process.usage.cpu_seconds() - before) / (time.monotonic() - began) * 100


def missed_between(before: Counts, after: Counts) -> Missed:
    """Return the pictures that were missed.

    Raises:
        ValueError: a camera gave no pictures, so nothing can be said.
    """
    taken = _grown(before.taken, after.taken)
    if not taken or min(taken.values()) <= 0:
        raise ValueError(f"a camera without pictures: {taken}")
    dues = [_grown(before.tiers[tier], after.tiers[tier]) for tier in after.tiers]
    received = lost = mixed = 0
    for earlier, later in zip(before.received, after.received, strict=True):
        came = {camera: later[camera][0] - earlier[camera][0] for camera in taken}
        received += sum(came.values())
        lost += sum(later[camera][1] - earlier[camera][1] for camera in taken)
        mixed += came not in dues
    return Missed(received, after.dropped - before.dropped, lost, mixed)


def _grown(before: dict[str, int], after: dict[str, int]) -> dict[str, int]:
    return {camera: count - before.get(camera, 0) for camera, count in after.items()}


def _results(found: Watched, bare: dict[int, float]) -> list[Result]:
    count, alone, watched = found.count, found.alone, found.watched
    missed = missed_between(found.before, found.after)
    taken = sum(_grown(found.before.taken, found.after.taken).values())
    conditions = (
        f"{count} observers of all cameras and sound, {missed.received / count:.0f} pictures each of {taken}, "
        f"{missed.dropped} dropped at the console and {missed.lost} packets lost on the way, of all; {missed.mixed} "
        f"observers have a number of pictures that is no tier's; "
        f"console {watched.console_cpu:.0f} % of a core, {alone.console_cpu:.0f} % without observers; "
        f"the observers' own processes {watched.audience_cpu:.0f} %"
    )
    aiortc = f"plain aiortc, main camera only, encoded per peer, {BARE_PEERS} peers ({bare[1]:.1f} % with 1 peer)"
    without = "the same operator without observers"

    def row(name: str, value: float, unit: str, baseline: float, against: str, **fields: object) -> Result:
        known = {"section": SECTION, "samples": len(watched.trips), "conditions": conditions}
        return Result(
            name=f"{count} observers: {name}",
            value=value,
            unit=unit,
            baseline=baseline,
            baseline_name=against,
            **known,  # type: ignore[arg-type]
            **fields,  # type: ignore[arg-type]
        )

    each = (watched.console_cpu - alone.console_cpu) / count
    ours, theirs = median(watched.trips), median(alone.trips)
    core = {"target": CORE} if count == max(CROWDS) else {}
    return [
        row("pictures missed", missed.percent, "%", 0.0, "none", target=0.0),
        row("processor time of each", each, "% of a core", bare[BARE_PEERS], aiortc, target=CPU_TARGET),
        row("console's processor time", watched.console_cpu, "% of a core", count * bare[BARE_PEERS], aiortc, **core),
        row("command → feedback, median", ours, "ms", theirs, without),
        row("command → feedback, p99", quantile(watched.trips, 0.99), "ms", quantile(alone.trips, 0.99), without),
        row("median to that without", ours / theirs, "×", 1.0, without, target=SLOWDOWN_TARGETS.get(count)),
    ]
