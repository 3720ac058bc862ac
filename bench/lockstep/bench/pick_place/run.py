"""Runs it through everything real: the arm in MuJoCo behind a bridge, a console that records, a network, a client."""

import asyncio
import shutil
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import httpx

from lockstep.bench.experiment.choices import media_of
from lockstep.bench.experiment.stage import Stage, running_stage
from lockstep.bench.pick_place.hands import LEADER_SCALES, LeaderHand, PolicyHand
from lockstep.bench.pick_place.judge import Judged, judge
from lockstep.bench.pick_place.motions import BLOCKS
from lockstep.bench.pick_place.operate import operate
from lockstep.bench.pick_place.script import Hand, PickAndPlace, ToolHand
from lockstep.client import Console
from lockstep.emulator.impairment.profile import load_profile

__all__ = ["Choices", "HandName", "pick_and_place", "recorder_of"]

HandName = Literal["tool", "leader", "policy"]
ROBOT: Final = "so101"
NO_NETWORK: Final = "perfect"
CONNECT_SECONDS: Final = 60.0  # through a bad network, with a busy machine
SILENCE_SECONDS: Final = 15.0
BLOCK_SECONDS: Final = 240.0
LANDS_SECONDS: Final = 15.0  # until the robot says that the block lies in the bowl


@dataclass(frozen=True)
class Choices:
    """
    Attributes:
        network: a profile; "" for none
        keep: a folder for the recordings and the bridge's event log; None: they are deleted
    """

    network: str = ""
    times: int = 10
    hand: HandName = "tool"
    seed: int = 1
    pictures: bool = True
    keep: Path | None = None


async def pick_and_place(choices: Choices, say: Callable[[str], None]) -> dict[str, Any]:
    """Put blocks into the bowl, and return the figures of each.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: a part did not start, or was lost.
    """
    profile = load_profile(choices.network or NO_NETWORK)
    async with running_stage(
        ROBOT, profile, media_of(profile), choices.seed, robot_link=bool(choices.network)
    ) as stage:
        link = stage.link if choices.network else stage.near_link
        async with (
            recorder_of(stage.near_link) as recorder,
            Console(
                link,
                video=2 if choices.pictures else False,
                audio=False,
                decode=choices.pictures,
                name=choices.hand,
                connect_seconds=CONNECT_SECONDS,
                silence_seconds=SILENCE_SECONDS,
            ) as console,
        ):
            await console.take_seat()
            stage.network.begin()
            session = _Session(stage, console, recorder, choices, say)
            runs = [await session.run(number) for number in range(choices.times)]
            statistics = console.stats()
    return {
        "network": choices.network,
        "hand": choices.hand,
        "placed": sum(run["placed"] for run in runs),
        "of": choices.times,
        "jumps": sum(run["refusals"].get("jump", 0) for run in runs),
        "largest_step": max(run["largest_step"] for run in runs),
        "verified": sum(run["verified"] for run in runs),
        "pictures": sum(each.rendered for each in statistics.streams),
        "violations": sum(each.violations for each in statistics.streams),
        "runs": runs,
    }


class _Session:
    def __init__(
        self, stage: Stage, console: Console, recorder: httpx.AsyncClient, choices: Choices, say: Callable[[str], None]
    ) -> None:
        self._stage, self._console, self._recorder = stage, console, recorder
        self._choices, self._say = choices, say

    async def run(self, number: int) -> dict[str, Any]:
        """Put one block into the bowl, beside those of the two runs before it, while it is recorded."""
        name, before = list(BLOCKS)[number % len(BLOCKS)], number % len(BLOCKS)
        if not before:
            await self._console.act("reset_scene")
            await self._in_bowl(0)
        recording = await self._record(f"{self._choices.hand} {number + 1} {name}")
        task, began = PickAndPlace(self._console.description, name, self._hand()), time.monotonic()
        async with asyncio.timeout(BLOCK_SECONDS):
            armed = await operate(self._console, task)
        seconds = time.monotonic() - began
        placed = task.done and await self._in_bowl(before + 1)
        judged = await self._judged(recording)
        self._say(_line(number, name, placed, judged, seconds, armed) + (f": {task.failed}" if task.failed else ""))
        return {
            "block": name,
            "placed": placed,
            "failed": task.failed,
            "seconds": round(seconds, 1),
            "events": judged.events,
            "events_per_second": round(judged.events / judged.seconds, 1) if judged.seconds else 0.0,
            "armed_anew": armed,
            "refusals": dict(judged.refusals),
            "largest_step": round(judged.step, 3),
            "largest_step_axis": judged.step_axis,
            "verified": judged.verdict.ok,
            "broken": [check for check, each in judged.verdict.checks.items() if not each.ok],
        }

    def _hand(self) -> Hand:
        console = self._console
        if self._choices.hand == "leader":
            return LeaderHand(console.description, console.clutch(LEADER_SCALES))
        return PolicyHand(console.description) if self._choices.hand == "policy" else ToolHand(console.description)

    async def _in_bowl(self, count: int) -> bool:
        """Wait until the robot says that so many blocks lie in the bowl."""
        try:
            async with asyncio.timeout(LANDS_SECONDS):
                async for _ in self._console.feedbacks():
                    if any(item.name == "bowl" and item.value == count for item in self._console.status):
                        return True
        except TimeoutError:
            pass
        return False

    async def _record(self, name: str) -> str:
        answer = await self._recorder.post("/api/recordings", json={"name": name})
        recording: str = answer.raise_for_status().json()["recording"]
        return recording

    async def _judged(self, recording: str) -> Judged:
        (await self._recorder.post("/api/recordings/stop")).raise_for_status()
        [path] = self._stage.event_log.parent.rglob(f"*{recording}*.mcap")
        judged = await asyncio.to_thread(judge, path)
        if self._choices.keep is not None:
            self._choices.keep.mkdir(parents=True, exist_ok=True)
            for each in (path, self._stage.event_log):
                await asyncio.to_thread(shutil.copy, each, self._choices.keep)
        return judged


@asynccontextmanager
async def recorder_of(link: str) -> AsyncIterator[httpx.AsyncClient]:
    """Speak to the console about recordings. `link`: an operator's, past the network."""
    url, _, fragment = link.partition("/#")
    token = fragment.partition("token=")[2].partition("&")[0]
    async with httpx.AsyncClient(base_url=url, trust_env=False, timeout=60.0) as http:
        http.headers["Authorization"] = f"Bearer {token}"
        yield http


def _line(number: int, name: str, placed: bool, judged: Judged, seconds: float, armed: int) -> str:
    verified = "verified" if judged.verdict.ok else "BROKEN"
    where = "in the bowl" if placed else "NOT in the bowl"
    refused = ", ".join(f"{count} {reason}" for reason, count in judged.refusals.items()) or "none"
    return (
        f"{number + 1}: {name} {where} after {seconds:.1f} s and {judged.events} events, refused {refused}, "
        f"armed anew {armed} times, "
        f"largest step {judged.step:.2f} of {judged.step_axis}'s limit, {verified}"
    )
