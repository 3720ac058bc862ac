"""One drive behind a robot's uplink: a robot, the network in front of it, a console and a headless client."""

import asyncio
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

from lockstep.bench.figures.samples import quantile
from lockstep.bench.harness.driving import drive_on, round_and_round
from lockstep.bench.harness.event_log import records
from lockstep.bench.harness.processes import Running
from lockstep.bench.harness.stack import running_bridge, running_console
from lockstep.bench.quality.freezes import freezes
from lockstep.client import Console, ConsoleLost, NotArmed
from lockstep.emulator import NetworkProcess, Profile

__all__ = ["measure"]

SETTLE = 5.0  # s in which the bitrate finds its measure
LOOK = 0.1  # s between two looks whether the robot was reached
PATIENCE = 30.0  # s for the robot to be reached
LOG_DELAY = 0.5  # s until the bridge's log is on disk


async def measure(
    profile: Profile, robot: str, options: Sequence[str], *, seconds: float, tolerance: int, seed: int
) -> dict[str, Any]:
    """Drive for `seconds` and return the figures. `options`: of the bridge."""
    async with (
        running_bridge(robot, options=options) as bridge,
        NetworkProcess(profile, robot=_place(bridge.address), seed=seed) as network,
        running_console(network.robot_address, environment=_settings(bridge.event_log.parent)) as (console, links),
        Console(links["operator"], tolerance=tolerance, codec="H264", name="bench") as client,
        asyncio.TaskGroup() as tasks,
    ):
        async with asyncio.timeout(PATIENCE):  # the description itself takes a second on a narrow uplink
            while client.feedback is None:  # noqa: ASYNC110
                await asyncio.sleep(LOOK)
        await client.take_seat()
        shown: list[tuple[float, int, int]] = []  # time, stamp, gap
        watching = tasks.create_task(_watch(client, shown))
        await _drive(client, SETTLE)
        shown.clear()
        began, before = time.monotonic(), _use(network, bridge.process, console)
        events = await _drive(client, seconds)
        passed = time.monotonic() - began
        used = [after - earlier for earlier, after in zip(before, _use(network, bridge.process, console), strict=True)]
        watching.cancel()
        await asyncio.sleep(LOG_DELAY)
        captured = _first_captures(bridge.event_log, client.description.cameras[0].name)
    return {
        "media_kbit_s": round(8 * used[0] / passed / 1000),
        "control_kbit_s": round(8 * used[1] / passed / 1000),
        "bridge_cpu_percent": round(100 * used[2] / passed, 1),
        "console_cpu_percent": round(100 * used[3] / passed, 1),
        "events_per_second": round(events / passed, 1),
        **_figures(shown, captured, passed, tolerance),
    }


def _place(address: str) -> tuple[str, int]:
    parts = urlsplit(address)
    return parts.hostname or "", parts.port or 0


def _settings(folder: Any) -> dict[str, str]:
    return {"LOCKSTEP_STATE_DIR": str(folder / "state")}


def _use(network: NetworkProcess, bridge: Running, console: Running) -> list[float]:
    """Return bytes of media and of the rest on the robot link towards the console, and processor seconds."""
    paths = network.statistics().paths
    sent = [float(paths[name]["to_operator"].bytes) for name in ("robot_media", "robot_control")]
    return [*sent, bridge.usage.cpu_seconds(), console.usage.cpu_seconds()]


async def _drive(client: Console, seconds: float) -> int:
    """Drive in circles, as fast as events come; return their number."""
    values, first = round_and_round(client.description), client.feedback.event if client.feedback is not None else 0
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            while True:
                with suppress(NotArmed):  # a busy machine has held the robot up: it waits to be armed again
                    await drive_on(client, values(time.monotonic()))
    return (client.feedback.event if client.feedback is not None else 0) - first


async def _watch(client: Console, shown: list[tuple[float, int, int]]) -> None:
    """Note the main camera's pictures that pass the gate."""
    with suppress(ConsoleLost):
        async for picture in client.pictures(keep=30):
            if picture.stamp is not None and picture.gap is not None:
                shown.append((time.monotonic(), picture.stamp, picture.gap))


def _first_captures(log: Any, stream: str) -> dict[int, float]:
    """Return when the first picture of each event was captured, on this machine's monotonic clock."""
    found: dict[int, float] = {}
    for record in records(log):
        if record["kind"] == "media" and record["stream"] == stream:
            found.setdefault(record["event"], record["captured"])
    return found


def _figures(
    shown: Sequence[tuple[float, int, int]], captured: dict[int, float], seconds: float, tolerance: int
) -> dict[str, Any]:
    """Return the figures of the shown pictures; a picture's delay is that of the first shown of its event."""
    times = [at for at, _, _ in shown]
    delays, seen = [], set[int]()
    for at, stamp, _ in shown:
        if stamp not in seen and stamp in captured:
            delays.append((at - captured[stamp]) * 1000)
        seen.add(stamp)
    frozen = freezes(times)
    intervals = [later - earlier for earlier, later in zip(times, times[1:], strict=False)]
    return {
        "pictures_per_second": round(len(shown) / seconds, 1),
        "capture_to_shown_median_ms": round(quantile(delays, 0.5)) if delays else None,
        "capture_to_shown_p95_ms": round(quantile(delays, 0.95)) if delays else None,
        "longest_without_picture_s": round(max(intervals, default=seconds), 2),
        "freezes_per_minute": round(len(frozen) * 60 / seconds, 1),
        "largest_gap": max((abs(gap) for _, _, gap in shown), default=None),
        "violations": sum(abs(gap) > tolerance for _, _, gap in shown),
    }
