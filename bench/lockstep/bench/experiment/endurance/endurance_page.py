"""An endurance run's client as a page: Chromium through Playwright, Firefox through WebDriver BiDi."""

import asyncio
import json
import shutil
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from lockstep.bench.browsers.chromium import PAD, open_page, running_chromium
from lockstep.bench.browsers.firefox import running_firefox
from lockstep.bench.browsers.pad import RB, START
from lockstep.bench.browsers.sound_card import running_sound_card
from lockstep.bench.experiment.browser import pad_axes, robot_description
from lockstep.bench.experiment.choices import Choices
from lockstep.bench.experiment.endurance.endurance import Endurance
from lockstep.bench.experiment.operator_script import OperatorScript
from lockstep.protocol.description import RobotDescription

__all__ = ["PageHands", "driven_page"]

Evaluate = Callable[[str], Awaitable[Any]]

LOOK_SECONDS = 0.1
PRESS_SECONDS = 0.08  # a press is no shorter
STATS = "window.lockstep?.stats() ?? null"
REQUEST = """[...document.querySelectorAll("button")]
  .find((each) => each.textContent.trim() === "Request control" && !each.disabled && each.offsetParent)?.click() ?? 0"""


class PageHands:
    """Operates a pad, and reads the page's statistics."""

    def __init__(self, evaluate: Evaluate, description: RobotDescription, seed: int) -> None:
        self._evaluate = evaluate
        self._description = description
        self._script = OperatorScript(description.axes, seed)

    async def until_live(self) -> None:
        while True:
            found = await self._evaluate(STATS)
            if found is not None and any(each["rendered"] for each in found["streams"].values()):
                return
            await asyncio.sleep(LOOK_SECONDS)

    async def run(self, endurance: Endurance, clock: Callable[[], float]) -> None:
        while True:
            found = await self._evaluate(STATS)
            mine = bool(found["seat"] and found["seat"]["mine"])
            driving = mine and found["armed"]
            endurance.look(clock(), live=found["connected"], mine=mine, driving=driving, streams=found["streams"])
            await self._act(found, mine, clock())
            await asyncio.sleep(LOOK_SECONDS)

    async def _act(self, found: dict[str, Any], mine: bool, at: float) -> None:
        """Ask for the seat, arm and move the stick, whenever the page allows it."""
        if not found["connected"] or not mine or not found["armed"]:
            await self._press(RB, False)  # arming needs the deadman seen released first
        if not found["connected"]:
            return
        if not mine:
            await self._evaluate(REQUEST)
        elif not found["armed"]:
            await self._press(START, True)
            await asyncio.sleep(PRESS_SECONDS)
            await self._press(START, False)
        else:
            move = self._script.at(at, [0.0] * len(self._description.axes))  # a stick says how far, not where
            await self._press(RB, not move.pause)
            tilts = pad_axes(self._description.layers[0], self._description.axes, move.values)
            await self._evaluate(f"{json.dumps(list(tilts.items()))}.forEach((each) => window.testPad.tilt(...each))")

    async def _press(self, button: int, pressed: bool) -> None:
        await self._evaluate(f"window.testPad.press({button}, {json.dumps(pressed)})")


@asynccontextmanager
async def driven_page(browser: Literal["chromium", "firefox"], link: str, choices: Choices) -> AsyncIterator[PageHands]:
    """Open a page with the choices' gate, pacing and tolerances. Raises the errors of the browser's driver."""
    async with AsyncExitStack() as stack:
        environment = None
        if shutil.which("pulseaudio") is not None:  # without a sound card the page has no sound to judge
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="lockstep-sound-")))
            environment = (await stack.enter_async_context(running_sound_card(folder))).environment
        opened = _chromium if browser == "chromium" else _firefox
        evaluate = await stack.enter_async_context(opened(link, environment))
        await _until_loaded(evaluate)
        settings = {
            "gate": choices.gate,
            "pacing": choices.pacing,
            "tolerance": {"video": choices.tolerance, "audio": choices.tolerance},
        }
        await evaluate(f"window.lockstep.configure({json.dumps(settings)})")
        yield PageHands(evaluate, await robot_description(link), choices.seed)


@asynccontextmanager
async def _chromium(link: str, environment: dict[str, str] | None) -> AsyncIterator[Evaluate]:
    async with running_chromium(environment) as browser, open_page(browser, link, pad=True) as page:
        yield page.evaluate


@asynccontextmanager
async def _firefox(link: str, environment: dict[str, str] | None) -> AsyncIterator[Evaluate]:
    async with running_firefox(environment) as firefox:
        await firefox.prepare(await asyncio.to_thread(PAD.read_text))
        await firefox.open(link)
        yield firefox.evaluate


async def _until_loaded(evaluate: Evaluate) -> None:
    end = time.monotonic() + 30.0
    while await evaluate(STATS) is None:
        if time.monotonic() > end:
            raise TimeoutError("the page did not load within 30 s")
        await asyncio.sleep(LOOK_SECONDS)
