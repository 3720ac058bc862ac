"""The planned episodes, through a network if one is given, with a fault after every few of them.

Each fault strikes in an episode of its own, beside the planned ones. Then robot, network, console and drivers begin
anew in the same folder, as people do after a crash. The dataset of the whole day must have exactly what was kept. So
must a second one, to which episodes are appended while they are driven, by a process that is killed at each fault.
"""

import asyncio
import json
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack, ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from lockstep.bench.episodes.dataset import Kept, export, judged
from lockstep.bench.episodes.faults.fault_run import DISK_FAULTS, ROBOT, FaultName, FaultRun, following
from lockstep.bench.episodes.faults.faults import meet, settings_of
from lockstep.bench.episodes.plan import DRIVERS, Planned, plan
from lockstep.bench.episodes.run import Choices, figures_of, keep_files, links_of, policy_link
from lockstep.bench.episodes.session import Done, Session, drivers
from lockstep.bench.episodes.small_disk import cancel_on_sigterm, small_disk
from lockstep.bench.experiment.choices import media_of
from lockstep.bench.experiment.stage import running_stage
from lockstep.bench.harness.processes import started
from lockstep.bench.pick_place.run import recorder_of
from lockstep.emulator.impairment.profile import load_profile

__all__ = ["Day", "record_faulted_day", "shares"]

NO_NETWORK: Final = "perfect"
APPENDED: Final = ("rows", "pictures", "unreadable", "outside", "mislabelled", "gaps", "wrong", "verified")
DISK_BYTES: Final = 1 << 30  # for the recordings of a whole day


@dataclass
class Day:
    """What has become of the day until now.

    Attributes:
        kept: that must be in the dataset, in their order
        perhaps: places in `kept` of those that may be missing: nobody was told that they are on the disk
    """

    done: list[Done] = field(default_factory=list)
    kept: list[Kept] = field(default_factory=list)
    perhaps: set[int] = field(default_factory=set)
    faults: list[dict[str, Any]] = field(default_factory=list)

    def add(self, done: Sequence[Done], run: FaultRun) -> None:
        self.done += done
        self.kept += [each.kept for each in done if each.kept is not None]
        self.kept += run.kept
        for each in run.perhaps:
            self.perhaps.add(len(self.kept))
            self.kept.append(each)
        self.faults.append({"fault": run.fault, "said": run.said, "wrong": run.wrong, "ok": not run.wrong})

    @property
    def told(self) -> list[Kept]:
        """The episodes of which somebody was told that they are kept."""
        return [each for place, each in enumerate(self.kept) if place not in self.perhaps]

    async def judged(self, root: Path, said: str) -> dict[str, Any]:
        """Return what a dataset of the day is like. `said`: by the export, when it failed."""
        if said:
            return {"wrong": [f"export: {said}"]}
        found = await judged(root, self.told)
        if found["wrong"] and self.perhaps:  # of one at most, which kill-keeping leaves open
            found = await judged(root, self.kept)
        return found


async def record_faulted_day(
    choices: Choices, faults: Sequence[FaultName], say: Callable[[str], None]
) -> dict[str, Any]:
    """Record the planned episodes with faults between them; return the figures of both and of the dataset.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: a part did not start, or was lost other than by a fault.
    """
    cancel_on_sigterm()
    planned = plan(choices.times, choices.discard, choices.redo, choices.seed)
    day = Day()
    with TemporaryDirectory(prefix="lockstep-bench-") as directory, ExitStack() as stack:
        folder = Path(directory)
        recordings, root, live = folder / "recordings", folder / "dataset", folder / "live"
        recordings.mkdir()
        if set(faults) & set(DISK_FAULTS):
            stack.enter_context(small_disk(recordings, DISK_BYTES))
        for number, (fault, some) in enumerate(zip(faults, shares(planned, len(faults)), strict=True)):
            await _until_fault(choices, fault, some, folder, day, say, seed=choices.seed + number)
        files = sorted(recordings.glob("*.mcap"))
        dataset = await day.judged(root, await export(files, root))
        in_time = await asyncio.to_thread(_appended, live)
        appended = await day.judged(live, await export(files, live, append=True))
        await asyncio.to_thread(keep_files, choices.keep, files, root)
    figures = figures_of(choices, day.done, dataset)
    ok = figures["ok"] and not appended["wrong"] and all(each["ok"] for each in day.faults)
    more = {"faults": day.faults, "in_dataset": len(dataset.get("rows", [])), "ok": ok}
    told = {name: each for name, each in appended.items() if name in APPENDED} | {"while_driving": in_time}
    return figures | more | {"appended": told}


def _appended(root: Path) -> int:
    """Return how many episodes a dataset has."""
    info = root / "meta" / "info.json"
    return int(json.loads(info.read_text())["total_episodes"]) if info.exists() else 0


def shares(planned: Sequence[Planned], count: int) -> list[Sequence[Planned]]:
    """Return the episodes in as many parts, in their order; sizes differ by one at most."""
    return [planned[len(planned) * k // count : len(planned) * (k + 1) // count] for k in range(count)]


async def _until_fault(
    choices: Choices,
    fault: FaultName,
    planned: Sequence[Planned],
    folder: Path,
    day: Day,
    say: Callable[[str], None],
    *,
    seed: int,
) -> None:
    """Run some planned episodes, then meet the fault in another one. Everything ends with it."""
    profile, through = load_profile(choices.network or NO_NETWORK), bool(choices.network)
    settings = settings_of(fault) | {"LOCKSTEP_STATE_DIR": str(folder)}
    async with AsyncExitStack() as stack:
        stage = await stack.enter_async_context(
            running_stage(ROBOT, profile, media_of(profile), seed, robot_link=through, settings=settings)
        )
        follower = await stack.enter_async_context(started(following(folder)))
        recorder = await stack.enter_async_context(recorder_of(stage.near_link))
        named = await links_of(stage, recorder, through=through)
        consoles = await stack.enter_async_context(drivers(named, pictures=choices.pictures))
        stage.network.begin()
        session = Session(consoles, say)
        done = [await session.run(each) for each in planned]
        driver = await session.person()
        policy = stage.network.link(await policy_link(recorder)) if through else await policy_link(recorder)
        name = DRIVERS[consoles.index(driver)]
        run = FaultRun(fault, folder, stage.bridge, stage.console, driver, stage.near_link, policy, name)
        await meet(run)
        day.add(done, run)
        say(f"{fault}: {'; '.join(run.wrong) or 'right'}; the console said: {'; '.join(run.said)}")
        await follower.kill()
        await stage.console.end()  # one that still lives ends its recording
