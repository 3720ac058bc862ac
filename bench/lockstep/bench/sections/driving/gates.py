"""Compares the pictures that three gates let through in one session: by event, by age, and none.

A client beside the robot drives at a fixed rate; three headless clients look on through the `hong-kong` network, each
with another gate. `lockstep experiment growth` shows the same at more rates, with slower players.
"""

from lockstep.bench.context import Context
from lockstep.bench.experiment.choices import Choices
from lockstep.bench.experiment.endurance.growth import Point, run_growth
from lockstep.bench.experiment.judge.record import Gate
from lockstep.bench.figures.results import Result
from lockstep.emulator.impairment.profile import load_profile

__all__ = ["run"]

SECTION = "gates"
PROFILE = "hong-kong"
TOLERANCE = 2
RATES, QUICK_RATES = (5.0, 20.0), (20.0,)  # events a second
SECONDS, QUICK_SECONDS = 12, 4
VIEWERS: tuple[tuple[Gate, float], ...] = (("event", 0.0), ("age", 0.0), ("off", 0.0))
BASELINES = {
    "age": "a gate by age: media captured at most 0.5 s ago, by clocks that agree",
    "off": "no gate",
}


async def run(context: Context) -> list[Result]:
    seconds = context.scale(SECONDS, QUICK_SECONDS)
    choices = Choices(PROFILE, "feedback", seconds, TOLERANCE, seed=1)
    rates = QUICK_RATES if context.quick else RATES
    growth = await run_growth(choices, load_profile(PROFILE), context.say, rates=rates, viewers=VIEWERS)
    return [result for ours, *others in _by_rate(growth.points) for other in others for result in _compare(ours, other)]


def _by_rate(points: list[Point]) -> list[list[Point]]:
    """Return the viewers of each rate, in their order."""
    return [points[first : first + len(VIEWERS)] for first in range(0, len(points), len(VIEWERS))]


def _compare(ours: Point, other: Point) -> list[Result]:
    against = BASELINES[other.gate]
    conditions = (
        f"{PROFILE}, tolerance {TOLERANCE} events, the main camera, planar robot; "
        f"{ours.received} pictures received at {ours.event_rate:.1f} events/s"
    )

    def row(name: str, value: float, baseline: float, unit: str, target: float | None = None) -> Result:
        return Result(
            section=SECTION,
            name=f"{ours.event_rate:.0f} events/s: {name}, to {other.gate}",
            value=value,
            unit=unit,
            target=target,
            baseline=baseline,
            baseline_name=against,
            samples=ours.received,
            conditions=conditions,
        )

    return [
        row("rendered beyond the tolerance", _share(ours.violations, ours), _share(other.violations, other), "%", 0.0),
        row("largest gap rendered", ours.max_gap, other.max_gap, "events", TOLERANCE),
        row("rendered", _share(ours.rendered, ours), _share(other.rendered, other), "%"),
    ]


def _share(count: int, point: Point) -> float:
    """Return the share of the pictures received, in %."""
    return 100 * count / max(1, point.received)
