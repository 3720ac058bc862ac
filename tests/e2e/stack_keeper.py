"""A console that tests have in turn."""

from collections.abc import Mapping
from contextlib import AsyncExitStack

import pytest

from tests.e2e.as_new import as_new
from tests.support.stack import Stack, running_stack

__all__ = ["HALF_RATE", "StackKeeper"]

# Pictures cost the most of all, here and in the browser. Tests that judge them have all of them: `full_rate`.
HALF_RATE = {"LOCKSTEP_MEDIA__VIDEO_FRAMES_PER_SECOND": "15"}


class StackKeeper:
    """One console for all tests that ask for it, as long as each leaves it as good as new."""

    def __init__(
        self,
        directories: pytest.TempPathFactory,
        *,
        extra: tuple[str, ...] = (),
        settings: Mapping[str, str] | None = None,
    ) -> None:
        self._directories = directories
        self._extra = extra
        self._settings = dict(settings or {})
        self._running = AsyncExitStack()
        self._stack: Stack | None = None
        self._full_rate = True

    async def stack(self, *, full_rate: bool) -> Stack:
        """Nobody is there, the robot is at rest, near where it starts and not stopped."""
        if self._stack is None or self._full_rate != full_rate or not await as_new(self._stack):
            await self.close()
            settings = self._settings | ({} if full_rate else HALF_RATE)
            started = running_stack(self._directories.mktemp("shared"), extra=self._extra, settings=settings)
            self._stack = await self._running.enter_async_context(started)
            self._full_rate = full_rate
        return await self._stack.from_here()

    async def close(self) -> None:
        self._stack = None
        await self._running.aclose()
