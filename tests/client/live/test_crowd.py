"""A crowd on a real console: three observers are one here."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any, cast

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from tests.support.stack import running_stack

KEPT = 12  # steps between pictures
INTERVAL = 1 / 30  # s between pictures of the camera
SECONDS = 30.0  # at most, for a loaded machine
SETTINGS = {
    "LOCKSTEP_MEDIA__CROWD_OBSERVERS": "2",
    # Whatever a loaded machine makes of round trips, the operator's tier has all pictures.
    "LOCKSTEP_MEDIA__QUALITY_START_BPS": "1600000",
    "LOCKSTEP_MEDIA__QUALITY_MIN_BPS": "1600000",
}


class Steps:
    """The capture times between the last pictures that one console could show, in s."""

    def __init__(self) -> None:
        self._steps: deque[float] = deque(maxlen=KEPT)
        self._last: int | None = None  # in 90 kHz

    async def watch(self, console: Console, changed: asyncio.Condition) -> None:
        with cast(Any, console)._live().media.stream("video", "").readers.open(50) as pictures:
            while True:
                time = (await pictures.get()).timestamp
                if self._last is not None:
                    self._steps.append((time - self._last) % 2**32 / 90_000)
                self._last = time
                async with changed:
                    changed.notify_all()

    @property
    def thinned(self) -> bool:
        """Whether no two pictures were neighbours."""
        return len(self._steps) == KEPT and min(self._steps) > 1.3 * INTERVAL

    @property
    def whole(self) -> bool:
        """Whether most were."""
        return sum(0.5 * INTERVAL < step < 1.3 * INTERVAL for step in self._steps) > KEPT / 2


async def drive(operator: Console) -> None:
    while True:
        await drive_on(operator, [0.0, 0.0, 0.3])


@asynccontextmanager
async def running(*tasks: asyncio.Task[None]) -> AsyncIterator[None]:
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def test_three_get_half_of_the_operators_pictures_and_who_stays_gets_all_again(tmp_path: Path) -> None:
    changed = asyncio.Condition()

    async def until(condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(SECONDS), changed:
            await changed.wait_for(condition)

    async with AsyncExitStack() as stack:
        lockstep = await stack.enter_async_context(running_stack(tmp_path, settings=SETTINGS))
        links = (lockstep.operator, *[lockstep.observer] * 3)
        consoles = [Console(link, audio=False) for link in links]
        crowd = await stack.enter_async_context(AsyncExitStack())
        for console, owner in zip(consoles, (stack, stack, crowd, crowd), strict=True):
            await owner.enter_async_context(console)
        await consoles[0].take_seat()
        steps = [Steps() for _ in consoles]
        watching = [
            asyncio.create_task(each.watch(console, changed)) for each, console in zip(steps, consoles, strict=True)
        ]
        async with running(asyncio.create_task(drive(consoles[0])), *watching):
            await until(lambda: steps[0].whole and all(each.thinned for each in steps[1:]))
            for console in consoles:
                for stream in console.stats().streams:
                    assert stream.rendered > 0
                    assert (stream.violations, stream.unstamped) == (0, 0)
                    assert stream.max_gap <= stream.tolerance
            await crowd.aclose()
            await until(lambda: steps[0].whole and steps[1].whole)
