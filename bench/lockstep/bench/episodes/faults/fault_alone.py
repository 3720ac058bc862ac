"""A fault by itself, in or after a second episode. A first one is kept, so that there is a dataset.

The dataset is made afterwards, and must have the kept episodes alone, whole.
"""

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from typing import Any, Final

from lockstep.bench.episodes.dataset import export, judged
from lockstep.bench.episodes.faults.fault_run import DISK_FAULTS, ROBOT, FaultName, FaultRun
from lockstep.bench.episodes.faults.faults import meet, settings_of
from lockstep.bench.episodes.run import policy_link
from lockstep.bench.episodes.session import drivers
from lockstep.bench.episodes.small_disk import cancel_on_sigterm, small_disk
from lockstep.bench.harness.stack import running_bridge, running_console
from lockstep.bench.pick_place.run import recorder_of
from lockstep.client import ConsoleLost

__all__ = ["run_fault"]

REST_SECONDS: Final = 5.0
DISK_BYTES: Final = 64 << 20  # of the small disk


async def run_fault(fault: FaultName, say: Callable[[str], None]) -> dict[str, Any]:
    """Try one fault; `ok` in the answer says whether the dataset is right and the console said so at the time.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: a part did not start, or was lost before the fault.
    """
    cancel_on_sigterm()
    async with _running(fault) as run:
        await run.keep_one()
        await run.go_home()
        await meet(run)
        with suppress(ConsoleLost, TimeoutError):
            async with asyncio.timeout(REST_SECONDS):  # a robot that was killed proves no rest
                await run.driver.rest()
        recordings = run.folder / "recordings"
        root = run.folder / "dataset"
        await run.console.end()  # one that still lives ends its recording
        if not root.exists():
            said = await export(sorted(recordings.glob("*.mcap")), root)
            run.wrong += [f"export: {said}"] if said else []
        found: dict[str, Any] = await judged(root, run.kept) if root.exists() else {}
        if found.get("wrong") and run.perhaps:
            found = await judged(root, [*run.kept, *run.perhaps])
        run.wrong += found.get("wrong", [])
        halves = [each.name for each in run.folder.glob("**/meta/info.json") if each.parent.parent != root]
        run.wrong += [f"a half-written dataset at {each}" for each in halves]
    figures = {
        "fault": fault,
        "said": run.said,
        "kept": len(run.kept),
        "in_dataset": len(found.get("rows", [])),
        "rows": found.get("rows", []),
        "left_out": found.get("left_out", []),
        "wrong": run.wrong,
        "ok": not run.wrong,
    }
    say(f"{fault}: {'right' if not run.wrong else '; '.join(run.wrong)}; the console said: {'; '.join(run.said)}")
    return figures


@asynccontextmanager
async def _running(fault: FaultName) -> AsyncIterator[FaultRun]:
    """Start bridge, console and driver, with a recording that runs from the start."""
    async with AsyncExitStack() as stack:
        bridge = await stack.enter_async_context(running_bridge(ROBOT))
        folder = bridge.event_log.parent
        if fault in DISK_FAULTS:
            (folder / "recordings").mkdir()
            stack.enter_context(small_disk(folder / "recordings", DISK_BYTES))
        settings = {
            "LOCKSTEP_STATE_DIR": str(folder),
            "LOCKSTEP_SECRET": secrets.token_urlsafe(32),
            "LOCKSTEP_SCENE": "false",
            **settings_of(fault),
        }
        console, links = await stack.enter_async_context(running_console(bridge.address, environment=settings))
        [driver] = await stack.enter_async_context(drivers([("Ada", links["operator"])], pictures=False))
        http = await stack.enter_async_context(recorder_of(links["operator"]))
        yield FaultRun(fault, folder, bridge.process, console, driver, links["operator"], await policy_link(http))
