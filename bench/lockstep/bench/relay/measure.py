"""Measures for the section `relay`: delay per hop, the cost of a crowd, and the effect of a killed relay."""

import asyncio
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.figures.samples import median
from lockstep.bench.harness.processes import Running
from lockstep.bench.relay.stage import RelayStage, relay_stage

__all__ = ["Crowd", "Killing", "crowd", "hop_delays", "killings"]

ROOMY = {"max_peers": "500", "max_unconnected": "500", "max_offer_burst": "2000", "max_address_connections": "2000"}
SETTLE = 3.0  # s
START_SECONDS, TRIES = 30.0, 3  # for a page to watch through a relay
BACK_SECONDS = 30.0  # the most that a page may take to be measured at all
CROWD_SECONDS = 400.0
CALM = (
    0.3  # s between the crowd's operator's commands: every feedback goes to each observer, on the machine that drives
)
NICE = ("nice", "-n", "19")  # observers have their own machines, and take the time that others leave


async def hop_delays(folder: Path, seconds: float) -> dict[str, list[float]]:
    """Return ages of rendered pictures in ms: "direct", "0" (through one Janus), "1" (through two)."""
    async with relay_stage(folder) as stage:
        await stage.add_janus("robot", 0)
        await stage.add_janus("robot", 1)
        await stage.add_console([("robot", 0), ("robot", 1)], "--observers-direct", "0")
        await stage.add_driver("robot")
        watchers = [await _delays(stage, "direct"), await _delays(stage, "relay"), await _delays(stage, "relay")]
        await asyncio.sleep(SETTLE)
        skipped = [len(watcher.output.said()) for watcher in watchers]
        await asyncio.sleep(seconds)
        found: dict[str, list[float]] = {}
        for watcher, skip in zip(watchers, skipped, strict=True):
            for said in watcher.output.said()[skip:]:
                found.setdefault(said["relay"] or "direct", []).extend(said["ages_ms"])
        return found


async def _delays(stage: RelayStage, mode: str) -> Running:
    watcher = await stage.start(
        "robot", [sys.executable, "-m", "lockstep.bench.relay.delays", stage.links["observer"], mode]
    )
    await watcher.line(r"ages_ms")
    return watcher


@dataclass(frozen=True)
class Crowd:
    """Runningor time in % of a core, and the operator's command → feedback times in ms, for a number of observers."""

    observers: int
    console: float
    janus: tuple[float, ...]
    audience: float
    trips_ms: list[float]
    packets: float  # a second, of all observers together
    least: float  # a second, of the observer with the fewest
    connect_seconds: float
    lost: dict[str, int]  # observers that are no longer connected, by reason

    @property
    def summary(self) -> str:
        janus = " + ".join(f"{share:.1f}" for share in self.janus)
        lost = ", ".join(f"{count} lost: {why}" for why, count in self.lost.items()) or "none lost"
        trip = f"{median(self.trips_ms):.1f} ms" if self.trips_ms else "none"
        return (
            f"{self.observers} observers: console {self.console:.1f} %, Janus {janus} %, {self.packets:.0f} packets/s, "
            f"at least {self.least:.0f} each, connected in {self.connect_seconds:.0f} s, {lost}; "
            f"command → feedback {trip}"
        )


async def crowd(folder: Path, counts: Sequence[int], seconds: float, say: Callable[[str], None]) -> list[Crowd]:
    """Measure the same session with more and more observers on two Janus, all in one network."""
    async with relay_stage(folder) as stage:
        await stage.add_janus("robot", 0)
        await stage.add_janus("robot", 1)
        await stage.add_console([("robot", 0), ("robot", 1)], "--observers-direct", "0", **ROOMY)
        driver = await stage.add_driver("robot", CALM)
        await asyncio.sleep(SETTLE)
        found = [await _look(stage, driver, None, 0, seconds)]
        say(f"relay: {found[-1].summary}")
        audience: Running | None = None
        for count in counts:
            if audience is not None:
                await audience.end()
            command = [
                *NICE,
                sys.executable,
                "-m",
                "lockstep.bench.relay.audience",
                stage.links["observer"],
                str(count),
            ]
            audience = await stage.start("robot", command)
            await audience.line(r'"connected"', CROWD_SECONDS)
            await asyncio.sleep(SETTLE)
            found.append(await _look(stage, driver, audience, count, seconds))
            say(f"relay: {found[-1].summary}")
        return found


async def _look(stage: RelayStage, driver: Running, audience: Running | None, count: int, seconds: float) -> Crowd:
    if stage.console is None:
        raise RuntimeError("no console")
    processes = [stage.console, *stage.janus, *([audience] if audience else [])]
    driven, heard = len(driver.output.said()), len(audience.output.said()) if audience else 0
    began, used = time.monotonic(), [process.usage.cpu_seconds() for process in processes]
    await asyncio.sleep(seconds)
    spent = time.monotonic() - began
    shares = [(each.usage.cpu_seconds() - before) / spent * 100 for each, before in zip(processes, used, strict=True)]
    trips = [trip for said in driver.output.said()[driven:] for trip in said["trips_ms"]]
    packets = least = connected = 0.0
    lost: dict[str, int] = {}
    if audience is not None:
        said = audience.output.said()
        connected = said[0]["connected"]
        first, last = said[max(1, heard)], said[-1]
        between = max(1e-3, last["at"] - first["at"])
        rates = [(now - before) / between for before, now in zip(first["packets"], last["packets"], strict=True)]
        packets, least, lost = sum(rates), min(rates), last["lost"]
    janus = len(stage.janus)
    return Crowd(
        count, shares[0], tuple(shares[1 : 1 + janus]), sum(shares[1 + janus :]), trips, packets, least, connected, lost
    )


@dataclass(frozen=True)
class Killing:
    """The killing of one relay while a page watches through it."""

    relay: str
    back_seconds: float  # until the page drew a picture that came another way
    before_ms: list[float]  # the operator's command → feedback times
    after_ms: list[float]  # from the killing on


async def killings(folder: Path, count: int, seconds: float) -> list[Killing]:
    """Kill relays in turn, each started again before the next one."""
    found: list[Killing] = []
    async with relay_stage(folder) as stage:
        await stage.add_janus("robot", 0)
        await stage.add_janus("operator", 1)
        await stage.add_console([("robot", 0), ("operator", 1)], "--observers-direct", "0")
        driver = await stage.add_driver()
        async with (
            stage.chromium("operator") as browser,
            open_console(browser, stage.links["observer"], width=1280, height=800, pad=False) as page,
        ):
            for _ in range(count):
                await _watching(page)
                await asyncio.sleep(seconds)
                found.append(await _kill(stage, driver, page, seconds))
    return found


async def _watching(page: ConsolePage) -> None:
    """Wait until the page watches through a relay, and reload it if it does not.

    A page that came before any relay carried the session stays direct.
    """
    for left in reversed(range(TRIES)):
        try:
            await page.until("s.relay !== null && s.streams.overview?.rendered > 3", START_SECONDS)
            return
        except AssertionError:
            if not left:
                raise
        await page.page.reload()


async def _kill(stage: RelayStage, driver: Running, page: ConsolePage, seconds: float) -> Killing:
    relay = str((await page.stats())["relay"])
    number = int(relay)
    driven, began = len(driver.output.said()), time.monotonic()
    await stage.janus[number].kill()
    await page.until(f"s.relay !== {relay!r} && s.streams.overview?.rendered > 0", BACK_SECONDS)
    back = time.monotonic() - began
    await asyncio.sleep(seconds)
    said = driver.output.said()
    before = [trip for each in said[:driven][-round(seconds) :] for trip in each["trips_ms"]]
    after = [trip for each in said[driven:] for trip in each["trips_ms"]]
    await stage.restart_janus("robot" if number == 0 else "operator", number)
    return Killing(relay, back, before, after)
