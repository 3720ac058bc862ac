"""Runs it through everything real: the arm in MuJoCo behind a bridge, a console that records, a network, a client."""

import asyncio
import shutil
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import httpx

from lockstep.bench.experiment.choices import media_of
from lockstep.bench.experiment.stage import Stage, running_stage
from lockstep.bench.pick_place.headless_operator import headless_operator
from lockstep.bench.pick_place.judge import Judged, judge
from lockstep.bench.pick_place.motions import BLOCKS, BOWL
from lockstep.bench.pick_place.operator import HandName, Operator, OperatorFailed
from lockstep.bench.pick_place.script import PickAndPlace
from lockstep.client import CommandRefused, ConsoleError
from lockstep.emulator.impairment.profile import load_profile

__all__ = ["Choices", "pick_and_place", "recorder_of"]

ROBOT: Final = "so101"
NO_NETWORK: Final = "perfect"
LANDS_SECONDS: Final = 15.0  # until the robot says that the block lies in the bowl
RESET_SECONDS: Final = 60.0

Say = Callable[[str], None]


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


async def pick_and_place(choices: Choices, say: Say) -> dict[str, Any]:
    """Put blocks into the bowl, and return the figures of each.

    Raises:
        ProcessFailed, ConsoleError, TimeoutError: a part did not start, or was lost.
    """
    profile = load_profile(choices.network or NO_NETWORK)
    async with (
        running_stage(ROBOT, profile, media_of(profile), choices.seed, robot_link=bool(choices.network)) as stage,
        recorder_of(stage.near_link) as recorder,
        _operator(stage, choices) as operator,
    ):
        stage.network.begin()
        session = _Session(stage, operator, recorder, choices, say)
        runs = [await session.run(number) for number in range(choices.times)]
        pictures = await operator.pictures()
    return {
        "network": choices.network,
        "hand": choices.hand,
        "placed": sum(run["placed"] for run in runs),
        "of": choices.times,
        "jumps": sum(run["refusals"].get("jump", 0) for run in runs),
        "largest_step": max(run["largest_step"] for run in runs),
        "verified": sum(run["verified"] for run in runs),
        "pictures": pictures.rendered,
        "violations": pictures.violations,
        "runs": runs,
    }


@asynccontextmanager
async def _operator(stage: Stage, choices: Choices) -> AsyncIterator[Operator]:
    link = stage.link if choices.network else stage.near_link
    name = choices.hand
    if name == "pad" or name == "headset":
        from lockstep.bench.pick_place.page_operator import page_operator  # needs Playwright, which only tests install

        async with page_operator(link, stage.near_link, name) as page:
            yield page
    else:
        async with headless_operator(link, name, pictures=choices.pictures) as client:
            yield client


class _Session:
    def __init__(
        self, stage: Stage, operator: Operator, recorder: httpx.AsyncClient, choices: Choices, say: Say
    ) -> None:
        self._stage, self._operator, self._recorder = stage, operator, recorder
        self._choices, self._say = choices, say

    async def run(self, number: int) -> dict[str, Any]:
        """Put one block into the empty bowl while it is recorded."""
        name = list(BLOCKS)[number % len(BLOCKS)]
        await self._reset()
        recording = await self._record(f"{self._choices.hand} {number + 1} {name}")
        operator, held_up = self._operator, Counter[str]()
        task = PickAndPlace(operator.description, name, operator.hand(), longest=operator.longest, bowl=BOWL)
        began = time.monotonic()
        failed = await self._operate(task, held_up)
        seconds = time.monotonic() - began
        placed = not failed and await self._lands()
        if not failed and not placed:
            failed = "all motions are done, and the robot does not say that the block lies in the bowl"
        judged = await self._judged(recording)
        self._say(_line(number, name, placed, judged, seconds, held_up) + (f": {failed}" if failed else ""))
        return {
            "block": name,
            "placed": placed,
            "failed": failed,
            "seconds": round(seconds, 1),
            "events": judged.events,
            "events_per_second": round(judged.events / judged.seconds, 1) if judged.seconds else 0.0,
            "armed_anew": held_up.total(),
            "held_up": dict(held_up),
            "refusals": dict(judged.refusals),
            "largest_step": round(judged.step, 3),
            "largest_step_axis": judged.step_axis,
            "verified": judged.verdict.ok,
            "broken": [check for check, each in judged.verdict.checks.items() if not each.ok],
        }

    async def _operate(self, task: PickAndPlace, held_up: Counter[str]) -> str:
        """Return what went wrong; "" if nothing did."""
        limit = self._operator.longest_block
        try:
            async with asyncio.timeout(limit):
                await self._operator.operate(task, held_up)
        except TimeoutError:
            return f"the block took longer than {limit:g} s; {task.where()}"
        except (CommandRefused, OperatorFailed) as error:
            return f"{error}; {task.where()}"
        except ConsoleError:
            self._say(f"the connection ended {task.where()}")
            raise
        return task.failed

    async def _reset(self) -> None:
        """Put blocks and bowl back.

        Raises:
            TimeoutError: the robot does not say that the bowl is empty.
        """
        async with asyncio.timeout(RESET_SECONDS):
            await self._operator.reset_scene()
            await self._operator.until_in_bowl(0)

    async def _lands(self) -> bool:
        """Wait until the robot says that the block lies in the bowl."""
        with suppress(TimeoutError):
            async with asyncio.timeout(LANDS_SECONDS):
                await self._operator.until_in_bowl(1)
            return True
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


def _line(number: int, name: str, placed: bool, judged: Judged, seconds: float, held_up: Counter[str]) -> str:
    verified = "verified" if judged.verdict.ok else "BROKEN"
    where = "in the bowl" if placed else "NOT in the bowl"
    return (
        f"{number + 1}: {name} {where} after {seconds:.1f} s and {judged.events} events, "
        f"refused {_counted(judged.refusals)}, armed anew {_counted(held_up)}, "
        f"largest step {judged.step:.2f} of {judged.step_axis}'s limit, {verified}"
    )


def _counted(reasons: Counter[str]) -> str:
    return ", ".join(f"{count} {reason}" for reason, count in reasons.items()) or "none"
