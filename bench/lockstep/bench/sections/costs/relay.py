"""Measures observers through real Janus: the delay that each adds, the cost of a crowd, and a Janus that is killed.

Everything runs in separate processes in network namespaces, which needs Linux, root and Debian's janus. The robot is
the planar one. Observers of the crowd count packets of the main camera and get the feedback; they decode nothing.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.relay.measure import Crowd, Killing, crowd, hop_delays, killings

__all__ = ["run"]

SECTION = "relay"
DELAY_SECONDS, QUICK_DELAY_SECONDS = 20, 4
CROWDS, QUICK_CROWDS = (1, 100, 300), (1, 10)
CROWD_SECONDS, QUICK_CROWD_SECONDS = 15, 4
KILLINGS, QUICK_KILLINGS = 4, 1
KILL_SECONDS = 6.0  # of driving before and after
BACK_LIMIT = 5.0  # s
SAME = 1.1  # times the operator's latency without the event


async def run(context: Context) -> list[Result]:
    results: list[Result] = []
    with TemporaryDirectory(prefix="lockstep-relay-") as folder:
        place = Path(folder)
        ages = await hop_delays(place / "delays", context.scale(DELAY_SECONDS, QUICK_DELAY_SECONDS))
        results += _delays(ages)
        context.say("relay: delays measured")
        counts = QUICK_CROWDS if context.quick else CROWDS
        crowds = await crowd(place / "crowd", counts, context.scale(CROWD_SECONDS, QUICK_CROWD_SECONDS), context.say)
        results += [each for found in crowds[1:] for each in _crowd(found, crowds)]
        context.say("relay: crowds measured")
        found = await killings(place / "kill", context.scale(KILLINGS, QUICK_KILLINGS), KILL_SECONDS)
        results += _killings(found)
    return results


def _delays(ages: dict[str, list[float]]) -> list[Result]:
    names = {"direct": "direct", "0": "one Janus", "1": "two Janus"}
    direct = median(ages["direct"])
    return [
        Result(
            section=SECTION,
            name=f"capture → rendered, {names[way]}, {share}",
            value=value,
            unit="ms",
            baseline=direct,
            baseline_name="direct, median",
            samples=len(samples),
            conditions="main camera, headless observers side by side, at the same time",
        )
        for way, samples in sorted(ages.items(), key=lambda each: each[0] != "direct")
        for share, value in (("median", median(samples)), ("p95", quantile(samples, 0.95)))
    ]


def _crowd(found: Crowd, crowds: list[Crowd]) -> list[Result]:
    nobody, one = crowds[0], crowds[1]
    count = found.observers
    janus = " + ".join(f"{share:.1f}" for share in found.janus)
    conditions = (
        f"{count} observers on two Janus, connected in {found.connect_seconds:.0f} s, {found.packets:.0f} packets/s in "
        f"all, at least {found.least:.0f} packets/s each; Janus {janus} % of a core, observers {found.audience:.0f} %"
    )

    def row(name: str, value: float, unit: str, baseline: float, against: str) -> Result:
        return Result(
            section=SECTION,
            name=f"{count} through relays: {name}",
            value=value,
            unit=unit,
            baseline=baseline,
            baseline_name=against,
            samples=len(found.trips_ms),
            conditions=conditions,
        )

    rows = [
        row("console's processor time", found.console, "% of a core", one.console, "with one observer"),
        row("console's processor time, all in", found.console, "% of a core", nobody.console, "without observers"),
        row("command → feedback, median", median(found.trips_ms), "ms", median(nobody.trips_ms), "without observers"),
    ]
    if found.packets:
        cost = sum(found.janus) / found.packets * 1e4
        rows.append(row("Janus per packet to an observer", cost, "µs", 0.0, ""))
    return rows


def _killings(found: list[Killing]) -> list[Result]:
    before = [trip for each in found for trip in each.before_ms]
    after = [trip for each in found for trip in each.after_ms]
    conditions = f"Janus killed in turn: {', '.join(each.relay for each in found)}; a page in Chromium watches"

    def row(name: str, value: float, unit: str, target: float, **more: object) -> Result:
        return Result(
            section=SECTION,
            name=name,
            value=value,
            unit=unit,
            target=target,
            conditions=conditions,
            **more,  # type: ignore[arg-type]
        )

    ratio = median(after) / median(before)
    slowest = max(each.back_seconds for each in found)
    return [
        row("relay killed: page draws again, slowest", slowest, "s", BACK_LIMIT, samples=len(found)),
        row("relay killed: command → feedback to before, median", ratio, "×", SAME, samples=len(after)),
        row("relay killed: command → feedback, median", median(after), "ms", SAME * median(before), samples=len(after)),
    ]
