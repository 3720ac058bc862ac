"""Consoles with the planar robot; one Chromium for all tests, since it starts slowly.

A test that ends, freezes or floods a part of its console, records, or looks for what only a new one says, has one of
its own. A test has browser contexts of its own: nothing is shared that a page can change. All run on one event loop,
because the browser belongs to the loop that started it.
"""

import os
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.firefox import Firefox, running_firefox
from lockstep.bench.browsers.sound_card import SoundCard, running_sound_card
from tests.e2e.as_new import as_new, emptied
from tests.support.stack import Stack, running_stack

HERE = Path(__file__).parent
# Pictures cost the most of all, here and in the browser. Tests that judge them have all of them: `full_rate`.
RATE, HALF = "LOCKSTEP_MEDIA__VIDEO_FRAMES_PER_SECOND", "15"

expect.set_options(timeout=30_000)  # ms; a page shows what it hears when a busy machine lets it draw


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    on_one_loop = pytest.mark.asyncio(loop_scope="session")
    for item in items:
        if HERE not in item.path.parents:
            continue
        if pytest_asyncio.is_async_test(item):
            item.add_marker(on_one_loop, append=False)
        if _listens(item):
            item.add_marker(pytest.mark.alone)


def _listens(item: pytest.Item) -> bool:
    return isinstance(item, pytest.Function) and "sound_card" in item.fixturenames


@pytest.fixture(autouse=True)
def half_rate(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every console that the test starts takes half of the pictures, unless the test judges them."""
    if not _wants_all(request):
        monkeypatch.setenv(RATE, HALF)


@pytest_asyncio.fixture(loop_scope="session")
async def own_stack(half_rate: None, tmp_path: Path) -> AsyncIterator[Stack]:
    """A console of the test's own, which it may break."""
    async with running_stack(tmp_path) as running:
        yield running


def _wants_all(request: pytest.FixtureRequest) -> bool:
    return request.node.get_closest_marker("full_rate") is not None


class RobotKeeper:
    """One console with another robot than the planar one for all tests of a file; the robot stays where it was left."""

    def __init__(self, directories: pytest.TempPathFactory) -> None:
        self._directories = directories
        self._running = AsyncExitStack()
        self._stack: Stack | None = None

    async def stack(self, robot: str) -> Stack:
        """Nobody is there, and the robot is at rest and not stopped. Always the same `robot`."""
        if self._stack is None or await emptied(self._stack) is None:
            await self.close()
            started = running_stack(self._directories.mktemp("file"), robot=robot, settings={RATE: HALF})
            self._stack = await self._running.enter_async_context(started)
        return await self._stack.from_here()

    async def close(self) -> None:
        self._stack = None
        await self._running.aclose()


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def robot_keeper(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[RobotKeeper]:
    """Takes half of the pictures."""
    keeper = RobotKeeper(tmp_path_factory)
    yield keeper
    await keeper.close()


class StackKeeper:
    """One console for all tests that ask for it, as long as each leaves it as good as new."""

    def __init__(self, directories: pytest.TempPathFactory) -> None:
        self._directories = directories
        self._running = AsyncExitStack()
        self._stack: Stack | None = None
        self._full_rate = True

    async def stack(self, *, full_rate: bool) -> Stack:
        """Nobody is there, the robot is at rest, near where it starts and not stopped."""
        if self._stack is None or self._full_rate != full_rate or not await as_new(self._stack):
            await self.close()
            settings = {} if full_rate else {RATE: HALF}
            started = running_stack(self._directories.mktemp("shared"), settings=settings)
            self._stack = await self._running.enter_async_context(started)
            self._full_rate = full_rate
        return await self._stack.from_here()

    async def close(self) -> None:
        self._stack = None
        await self._running.aclose()


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def stack_keeper(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[StackKeeper]:
    keeper = StackKeeper(tmp_path_factory)
    yield keeper
    await keeper.close()


@pytest_asyncio.fixture(loop_scope="session")
async def stack(request: pytest.FixtureRequest, stack_keeper: StackKeeper) -> Stack:
    """A console that other tests have used and will use."""
    return await stack_keeper.stack(full_rate=_wants_all(request))


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def sound_card(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[SoundCard]:
    async with running_sound_card(tmp_path_factory.mktemp("sound")) as card:
        yield card


class ChromiumKeeper:
    """Starts Chromium when it is first asked for, and again when it has crashed."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._environment = environment
        self._running = AsyncExitStack()
        self._browser: Browser | None = None

    async def browser(self) -> Browser:
        if self._browser is None or not self._browser.is_connected():
            await self.close()
            self._browser = await self._running.enter_async_context(running_chromium(self._environment))
        return self._browser

    async def close(self) -> None:
        self._browser = None
        await self._running.aclose()


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def chromium_keeper() -> AsyncIterator[ChromiumKeeper]:
    keeper = ChromiumKeeper(os.environ | {"PULSE_SERVER": "unix:/nowhere"})
    yield keeper
    await keeper.close()


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def loud_chromium_keeper(sound_card: SoundCard) -> AsyncIterator[ChromiumKeeper]:
    keeper = ChromiumKeeper(sound_card.environment)
    yield keeper
    await keeper.close()


@pytest_asyncio.fixture(loop_scope="session")
async def chromium(chromium_keeper: ChromiumKeeper) -> AsyncIterator[Browser]:
    """Without any page open, before and after, and without a sound card: what it plays, it plays to nobody."""
    async with _without_pages(chromium_keeper) as browser:
        yield browser


@pytest_asyncio.fixture(loop_scope="session")
async def loud_chromium(loud_chromium_keeper: ChromiumKeeper) -> AsyncIterator[Browser]:
    """The same with the sound card, which costs a tenth more."""
    async with _without_pages(loud_chromium_keeper) as browser:
        yield browser


@asynccontextmanager
async def _without_pages(keeper: ChromiumKeeper) -> AsyncIterator[Browser]:
    browser = await keeper.browser()
    yield browser
    for context in browser.contexts:  # what a test that failed has left
        await context.close()


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def file_firefox(sound_card: SoundCard) -> AsyncIterator[Firefox]:
    async with running_firefox(sound_card.environment) as browser:
        yield browser


@pytest_asyncio.fixture(loop_scope="session")
async def firefox(file_firefox: Firefox) -> AsyncIterator[Firefox]:
    """With the sound card and an empty page, before and after."""
    yield file_firefox
    await file_firefox.open("about:blank")
