"""Clients without a browser, which watch, check pixels, and drive."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import msgspec
import numpy as np

from lockstep.bench.experiment.choices import Choices
from lockstep.bench.experiment.judge.age_gate import client_gate
from lockstep.bench.experiment.judge.record import Arrival, ClientRecord, Gate, Rendered
from lockstep.bench.experiment.observation import Look, Observation
from lockstep.bench.experiment.operator_script import OperatorScript
from lockstep.bench.harness.driving import applied_goals, drive_on
from lockstep.client import Console, ConsoleLost, Picture
from lockstep.client.control.command_gate import Pacing
from lockstep.robot_bridge.robots.event_strip import read_event_strip

__all__ = ["HeadlessClient", "headless_client"]

CONNECT_SECONDS = 40.0  # through a bad network
SILENCE_SECONDS = 15.0  # of an outage that a run should survive
TICK = 0.005  # s; the loop's own timers are no finer under load


class HeadlessClient:
    """A client of a run. Enter `observed` around the run, and call `drive` inside it."""

    def __init__(self, console: Console, record: ClientRecord, camera: str) -> None:
        self.record = record
        self._console = console
        self._camera = camera
        self._streams = [camera, *(microphone.name for microphone in console.description.microphones)]

    @property
    def description(self) -> Any:
        return self._console.description

    async def take_seat(self) -> None:
        await self._console.take_seat()

    async def until_picture(self) -> None:
        """Wait until a picture passed the gate."""
        async for _ in self._console.pictures(self._camera):
            return

    @asynccontextmanager
    async def observed(self) -> AsyncIterator[None]:
        observation = Observation(self.record, self._look)
        await observation.begin()
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(each) for each in (observation.run(), self._check_pixels(), self._listen())]
            try:
                yield
            finally:
                for task in tasks:
                    task.cancel()
        await observation.end()

    async def _look(self) -> Look:
        console = self._console
        return Look(
            [Arrival(each.at, each.event) for each in console.feedback_log()],
            {name: [Rendered(*each) for each in console.rendered(name)] for name in self._streams},
            msgspec.to_builtins(console.stats()),
        )

    async def _check_pixels(self) -> None:
        try:
            async for picture in self._console.pictures(self._camera, keep=30):
                drawn = _drawn_event(picture)
                if drawn is None:
                    self.record.drawn_unreadable += 1
                elif drawn == picture.stamp:
                    self.record.drawn_right += 1
                else:
                    self.record.drawn_wrong += 1
        except ConsoleLost as error:
            self.record.lost = str(error)

    async def _listen(self) -> None:
        """Take the sound as somebody who plays it: the events follow its pace."""
        if not self._console.description.microphones:
            return
        with contextlib.suppress(ConsoleLost):  # which `_check_pixels` tells
            async for _ in self._console.sounds():
                pass

    async def drive(self, script: OperatorScript, seconds: float) -> None:
        """Follow the script: one command at a time, each as the answer to the last feedback."""
        began = time.monotonic()
        while (elapsed := time.monotonic() - began) < seconds:
            move = script.at(elapsed, applied_goals(self._console))
            try:
                async with asyncio.timeout(began + seconds - time.monotonic()):
                    await drive_on(self._console, move.values)
            except TimeoutError:
                break  # the run ends while a command is on its way
            await asyncio.sleep(max(0.0, move.interval - (time.monotonic() - began - elapsed)))

    async def rest(self) -> None:
        await self._console.rest()


def _drawn_event(picture: Picture) -> int | None:
    """Read the event from the luma plane itself: converting the picture would cost more than decoding it."""
    plane = picture.frame.planes[0]
    luma = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)[: plane.height, : plane.width]
    return read_event_strip(luma)


@asynccontextmanager
async def headless_client(
    link: str, choices: Choices, name: str, gate: Gate, pacing: Pacing, *, drives: bool
) -> AsyncIterator[HeadlessClient]:
    """Connect a client with the main camera and the first microphone.

    Raises the errors of `Console`.
    """
    async with Console(
        link,
        gate=client_gate(gate),
        pacing=pacing,
        tolerance=choices.tolerance,
        audio_tolerance=choices.tolerance,
        carrier="capture-time",  # has the time of capture of each medium, which every mode is measured by
        video=1,
        name=name,
        connect_seconds=CONNECT_SECONDS,
        silence_seconds=SILENCE_SECONDS,
    ) as console:
        record = ClientRecord(name, "headless", gate, pacing, drives, choices.tolerance)
        camera = console.description.cameras[0].name
        yield HeadlessClient(console, record, camera)
