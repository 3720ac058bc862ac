"""Drives as a page in Chromium: a pad follows the script, and the page's own figures are read."""

import asyncio
import shutil
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
import msgspec

from lockstep.bench.browsers.chromium import open_page, running_chromium
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.browsers.event_strip import drawn_event
from lockstep.bench.browsers.pad import RB
from lockstep.bench.browsers.page_clock import PageClock, read_page_clock
from lockstep.bench.browsers.sound_card import running_sound_card
from lockstep.bench.experiment.choices import Choices
from lockstep.bench.experiment.judge.age_gate import client_gate
from lockstep.bench.experiment.judge.record import Arrival, ClientRecord, Rendered
from lockstep.bench.experiment.observation import Look, Observation
from lockstep.bench.experiment.operator_script import OperatorScript
from lockstep.protocol.description import Axis, ControlLayer, RobotDescription

__all__ = ["BrowserClient", "browser_client", "pad_axes", "robot_description"]

PAD_AXES = {"left_x": 0, "left_y": 1, "right_x": 2, "right_y": 3}
PAD_STEP = 0.05  # s between two looks at the script
STRIP_STEP = 0.2  # s between two looks at the pixels
CONNECT_SECONDS = 60.0
LOOK = """(streams) => ({
  feedbacks: window.lockstep.feedbacks(),
  rendered: Object.fromEntries(streams.map((name) => [name, window.lockstep.rendered(name)])),
  statistics: window.lockstep.stats(),
})"""


def pad_axes(layer: ControlLayer, axes: Sequence[Axis], values: Sequence[float | None]) -> dict[int, float]:
    """Return the sticks' positions for `values`: -1 to 1 by the number of the pad's axis. Buttons stay untouched.

    A stick moves a goal axis for as long as it is held, by the share of `reach` that its value is; None: not at all.
    """
    by_name = {axis.name: (axis, value) for axis, value in zip(axes, values, strict=True)}
    found: dict[int, float] = {}
    for binding in layer.bindings:
        number = PAD_AXES.get(binding.pad or "")
        if number is None or binding.axis not in by_name:
            continue
        axis, value = by_name[binding.axis]
        if axis.kind == "goal" or value is None:
            share = 0.0 if value is None or not axis.reach else min(max(value / axis.reach, -1.0), 1.0)
            found[number] = -share if binding.invert_pad else share
            continue
        reach = (axis.maximum if value > axis.rest else 2 * axis.rest - axis.minimum) - axis.rest
        share = (value - axis.rest) / reach if reach else 0.0
        found[number] = -share if binding.invert_pad else share
    return found


class BrowserClient:
    """A page with the methods of `HeadlessClient`."""

    def __init__(
        self, page: ConsolePage, record: ClientRecord, description: RobotDescription, clock: PageClock
    ) -> None:
        self.record = record
        self.description = description
        self._page = page
        self._clock = clock
        self._camera = description.cameras[0].name
        self._streams = [self._camera, *(microphone.name for microphone in description.microphones)]

    async def take_seat(self) -> None:
        await self._page.until("s.seat && s.seat.mine", CONNECT_SECONDS)

    async def until_picture(self) -> None:
        await self._page.until(f"s.streams[{self._camera!r}]?.rendered > 0", CONNECT_SECONDS)

    @asynccontextmanager
    async def observed(self) -> AsyncIterator[None]:
        await self._page.arm()
        observation = Observation(self.record, self._look)
        await observation.begin()
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(observation.run()), group.create_task(self._check_pixels())]
            try:
                yield
            finally:
                for task in tasks:
                    task.cancel()
        await observation.end()

    async def _look(self) -> Look:
        found = await self._page.page.evaluate(LOOK, self._streams)
        return Look(
            [Arrival(self._clock.monotonic(each["at"]), each["event"]) for each in found["feedbacks"]],
            {name: [self._rendered(each) for each in entries] for name, entries in found["rendered"].items()},
            found["statistics"],
        )

    def _rendered(self, entry: Mapping[str, Any]) -> Rendered:
        age = entry["age"]
        return Rendered(
            self._clock.monotonic(entry["at"]),
            entry["stamp"],
            entry["gap"],
            entry["feedback"],
            None if age is None else age / 1000,
        )

    async def _check_pixels(self) -> None:
        """Check at intervals that the canvas shows the event of its stamp."""
        while True:
            await asyncio.sleep(STRIP_STEP)
            found = await drawn_event(self._page.page, self._camera)
            if found is None:
                continue
            stamp, drawn = found
            self.record.drawn_unreadable += drawn is None
            self.record.drawn_right += drawn == stamp
            self.record.drawn_wrong += drawn not in (None, stamp)

    async def drive(self, script: OperatorScript, seconds: float) -> None:
        """Let the sticks follow the script.

        The page sends as fast as its gate and the robot's event rate allow, and at its idle rate while the deadman is
        released.
        """
        page, axes, layer = self._page.page, self.description.axes, self.description.layers[0]
        began = time.monotonic()
        held, offsets = False, [0.0] * len(axes)  # a stick says how far, not where
        while (elapsed := time.monotonic() - began) < seconds:
            move = script.at(elapsed, offsets)
            tilts = [[number, value] for number, value in pad_axes(layer, axes, move.values).items()]
            await page.evaluate("(tilts) => tilts.forEach(([axis, value]) => window.testPad.tilt(axis, value))", tilts)
            if held == move.pause:
                held = not move.pause
                await self._page.pad.press(RB, held)
            await asyncio.sleep(PAD_STEP)
        await self._page.pad.press(RB, False)

    async def rest(self) -> None:
        await self._page.pad.press(RB, False)


@asynccontextmanager
async def browser_client(link: str, choices: Choices) -> AsyncIterator[BrowserClient]:
    """Open a page, connected, with the choices' gate, pacing and tolerances."""
    async with AsyncExitStack() as stack:
        environment = None
        if shutil.which("pulseaudio") is not None:  # without a sound card the page has no sound to judge
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="lockstep-sound-")))
            environment = (await stack.enter_async_context(running_sound_card(folder))).environment
        browser = await stack.enter_async_context(running_chromium(environment))
        page = await stack.enter_async_context(open_page(browser, link, pad=True))
        console = ConsolePage(page)
        await console.until("s.connected", CONNECT_SECONDS)
        tolerance = {"video": choices.tolerance, "audio": choices.tolerance}
        await page.evaluate(
            "(settings) => window.lockstep.configure(settings)",
            {"gate": client_gate(choices.gate), "pacing": choices.pacing, "tolerance": tolerance},
        )
        record = ClientRecord("operator", "chromium", choices.gate, choices.pacing, True, choices.tolerance)
        description = await robot_description(link)
        yield BrowserClient(console, record, description, await read_page_clock(page))


async def robot_description(link: str) -> RobotDescription:
    url, _, fragment = link.partition("/#token=")
    token = fragment.partition("&")[0]
    async with httpx.AsyncClient(trust_env=False, timeout=CONNECT_SECONDS) as http:
        session = await http.get(f"{url}/api/session", headers={"Authorization": f"Bearer {token}"})
    return msgspec.convert(session.json()["description"], RobotDescription, strict=False)
