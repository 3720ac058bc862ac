"""Runs it through everything real: the arm in MuJoCo, a bridge, a console that records, a network, three drivers."""

import asyncio
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import httpx

from lockstep.bench.episodes.dataset import export, judged
from lockstep.bench.episodes.plan import DRIVERS, POLICY, plan
from lockstep.bench.episodes.session import Done, Session, drivers
from lockstep.bench.experiment.choices import media_of
from lockstep.bench.experiment.stage import Stage, running_stage
from lockstep.bench.pick_place.run import recorder_of
from lockstep.emulator.impairment.profile import load_profile

__all__ = [
    "LINK_SECONDS",
    "ROBOT",
    "Choices",
    "figures_of",
    "keep_files",
    "links_of",
    "policy_link",
    "record_episodes",
]

ROBOT: Final = "so101"
NO_NETWORK: Final = "perfect"
COUNTDOWN: Final = "0.5"  # s
LINK_SECONDS: Final = 86_400


@dataclass(frozen=True)
class Choices:
    """
    Attributes:
        network: a profile; "" for none
        keep: a folder for the recordings and the dataset; None: they are deleted
    """

    network: str = ""
    times: int = 30
    discard: int = 6
    redo: int = 4
    seed: int = 1
    pictures: bool = True
    keep: Path | None = None


async def record_episodes(choices: Choices, say: Callable[[str], None]) -> dict[str, Any]:
    """Record episodes, make the dataset, and return the figures of both.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: a part did not start, or was lost.
    """
    planned = plan(choices.times, choices.discard, choices.redo, choices.seed)
    profile = load_profile(choices.network or NO_NETWORK)
    settings = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": COUNTDOWN}
    media, through = media_of(profile), bool(choices.network)
    async with running_stage(ROBOT, profile, media, choices.seed, robot_link=through, settings=settings) as stage:
        async with recorder_of(stage.near_link) as recorder:
            named = await links_of(stage, recorder, through=through)
            async with drivers(named, pictures=choices.pictures) as consoles:
                (await recorder.post("/api/recordings", json={"name": "episodes"})).raise_for_status()
                stage.network.begin()
                session = Session(consoles, say)
                done = [await session.run(each) for each in planned]
                (await recorder.post("/api/recordings/stop")).raise_for_status()
        state = stage.event_log.parent
        recordings = sorted((state / "recordings").glob("*.mcap"))
        root = state / "dataset"
        said = await export(recordings, root)
        kept = [each.kept for each in done if each.kept is not None]
        dataset = {"wrong": [f"export: {said}"]} if said else await judged(root, kept)
        await asyncio.to_thread(keep_files, choices.keep, recordings, root)
    return figures_of(choices, done, dataset)


async def links_of(stage: Stage, console: httpx.AsyncClient, *, through: bool) -> list[tuple[str, str]]:
    """Return the name and link of each of DRIVERS. `through`: they are reached through the network."""
    link = stage.link if through else stage.near_link
    policy = await policy_link(console)
    links = [link, link, stage.network.link(policy) if through else policy]
    return list(zip(DRIVERS, links, strict=True))


async def policy_link(console: httpx.AsyncClient) -> str:
    """Invite the policy, as a person does on the page."""
    asked = {"role": "policy", "name": DRIVERS[POLICY], "seconds": LINK_SECONDS}
    link: str = (await console.post("/api/invitations", json=asked)).raise_for_status().json()["link"]
    return link


def keep_files(folder: Path | None, recordings: Sequence[Path], root: Path) -> None:
    """Copy the recordings, and the dataset if there is one, to a folder; None: nothing is kept."""
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for path in recordings:
        shutil.copy(path, folder)
    if root.exists():
        shutil.copytree(root, folder / "dataset", dirs_exist_ok=True)


def figures_of(choices: Choices, done: Sequence[Done], dataset: dict[str, Any]) -> dict[str, Any]:
    found = zip(dataset.get("expected", []), dataset.get("rows", []), dataset.get("left_out", []), strict=False)
    rows = {kept["episode"]: (rows, left_out) for kept, rows, left_out in found}
    episodes = []
    for each in done:
        of_dataset = rows.get("" if each.kept is None else each.kept.episode, (0, 0))
        figures = asdict(each) | {"kept": each.kept is not None, "rows": of_dataset[0], "left_out": of_dataset[1]}
        episodes.append(figures)
    return {
        "network": choices.network,
        "episodes": len(done),
        "kept": sum(each.kept is not None for each in done),
        "discarded": sum(each.fate == "discard" for each in done),
        "redone": sum(each.fate == "redo" for each in done),
        "shared": sum(len(each.drivers) > 1 for each in done),
        "with_policy": sum(DRIVERS[POLICY] in each.drivers for each in done),
        "corrections": sum(each.corrections for each in done),
        "runs": episodes,
        "dataset": dataset,
        "ok": not dataset["wrong"],
    }
