"""What the bar of episodes says at once when a camera hangs, and when the disk fills, in Chromium."""

import asyncio
import os
import shutil
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.episodes.faults.fault_run import ROBOT
from lockstep.bench.episodes.faults.policy_fault import PROGRAM
from lockstep.bench.episodes.small_disk import small_disk
from lockstep.bench.harness.driving import drive_on
from lockstep.bench.harness.processes import started
from lockstep.bench.harness.stack import running_bridge
from lockstep.client import Console
from lockstep.client.console_url import parse_link
from lockstep.emulator import Network
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE
from lockstep.server.recording.reading.reader import RecordingReader
from tests.client.live.test_policies import policy_link
from tests.e2e.accessibility import findings
from tests.e2e.recordings.test_chromium_episodes import SETTINGS
from tests.e2e.so101 import SO101, needs_so101
from tests.support.stack import Stack, running_console, running_stack
from tests.waiting import PATIENCE, eventually

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]

SHOTS = os.environ.get("EPISODE_SHOTS", "")  # directory for pictures of the page, for people to look at
DISK_BYTES = 64 << 20
KEEPS_FREE = 16 << 20
OUTAGE_SECONDS = 20.0


@asynccontextmanager
async def _taking(chromium: Browser, stack: Stack, name: str) -> AsyncIterator[tuple[Locator, Console]]:
    """A supervisor's page with an open episode, and another driver."""
    async with (
        open_console(chromium, stack.supervisor) as console,
        Console(stack.operator, video=False, audio=False) as driver,
    ):
        await console.until_live()
        await driver.take_seat()
        bar = console.page.locator(".episode-bar")
        await _begin(console, bar.locator(".episode-words"))
        await expect(bar.locator(".episode-problems")).to_be_hidden()
        yield bar, driver
        assert await findings(console.page) == []
        if SHOTS:
            await console.page.screenshot(path=f"{SHOTS}/{name}.png")


def _states(folder: Path) -> list[str]:
    (path,) = folder.glob("*.mcap")
    with RecordingReader(path) as reader:
        return [each.state for each in reader.index.episodes]


@needs_so101
async def test_the_page_names_a_camera_that_hangs_while_an_episode_is_recorded(
    half_rate: None, tmp_path: Path, chromium: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, SO101[FOLDER_VARIABLE])
    monkeypatch.setenv("LOCKSTEP_EPISODES__COUNTDOWN_SECONDS", "1")
    async with running_bridge(ROBOT) as bridge:
        record = ("--record", str(tmp_path / "recordings"))
        async with (
            running_console(tmp_path, bridge.address, bridge.event_log, record) as stack,
            _taking(chromium, stack, "camera-hangs") as (bar, driver),
        ):
            hanging = driver.description.cameras[-1].name
            bridge.process.signal(signal.SIGUSR1)
            await expect(bar.locator(".episode-problems")).to_contain_text(f"{hanging}: no picture for ")
            await expect(bar.locator(".episode-problems")).to_be_visible()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a small disk")
async def test_the_page_says_that_the_disk_fills_and_then_that_the_episode_is_lost(
    tmp_path: Path, chromium: Browser
) -> None:
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    settings = {**SETTINGS, "LOCKSTEP_RECORDING__FREE_BYTES": str(KEEPS_FREE)}
    with small_disk(recordings, DISK_BYTES):
        ballast = recordings / "ballast"
        async with (
            running_stack(tmp_path, settings=settings, extra=("--record", str(recordings))) as stack,
            _taking(chromium, stack, "disk-full") as (bar, driver),
        ):
            await _fill(ballast, KEEPS_FREE * 9 // 8)
            await expect(bar.locator(".episode-problems")).to_contain_text("the disk is almost full: ")
            await drive_on(driver, [0.2, 0.0, 0.0])
            await _fill(ballast, KEEPS_FREE // 2)
            await expect(bar.locator(".episode-words")).to_contain_text(
                "Episode 1 is lost: only 8 MB are free on the disk"
            )
            await expect(bar.get_by_role("button", name="Keep")).to_be_hidden()
        ballast.unlink()
        assert _states(recordings) == ["open"], "it has no end in the file"


async def test_the_page_says_that_an_episode_is_lost_when_the_robots_bridge_is_killed(
    tmp_path: Path, chromium: Browser
) -> None:
    record = ("--record", str(tmp_path / "recordings"))
    async with (
        running_bridge("planar") as bridge,
        running_console(tmp_path, bridge.address, bridge.event_log, record) as stack,
        _taking(chromium, stack, "bridge-killed") as (bar, driver),
    ):
        await drive_on(driver, [0.2, 0.0, 0.0])
        await bridge.process.kill()
        await expect(bar.locator(".episode-words")).to_contain_text("Episode 1 is lost: the robot link was lost")
        await expect(bar.get_by_role("button", name="Keep")).to_be_hidden()


@pytest.mark.parametrize("phase", ["countdown", "open"])
async def test_the_page_says_what_became_of_an_episode_when_the_console_is_killed(
    tmp_path: Path, chromium: Browser, monkeypatch: pytest.MonkeyPatch, phase: str
) -> None:
    monkeypatch.setenv("LOCKSTEP_EPISODES__COUNTDOWN_SECONDS", "30" if phase == "countdown" else "0")
    record = ("--record", str(tmp_path / "recordings"))
    async with running_bridge("planar") as bridge, AsyncExitStack() as closing:
        async with running_console(tmp_path, bridge.address, bridge.event_log, record) as first:
            console = await closing.enter_async_context(open_console(chromium, first.supervisor))
            await console.until_live()
            bar = console.page.locator(".episode-bar")
            words = bar.locator(".episode-words")
            await bar.locator(".episode-task").fill("push the box")
            await bar.locator(".episode-task").press("Enter")
            await expect(words).to_contain_text("Take 1" if phase == "open" else "Begins in ")
            if phase == "open":
                await eventually(lambda: _states(tmp_path / "recordings") == ["open"])
            await first.running.kill()
        if phase == "open":
            await expect(words).to_have_text("Take 1: the console does not answer")
        else:
            await expect(words).to_have_text("The console does not answer")
        for name in ("Begin", "Keep", "Discard"):
            await expect(bar.get_by_role("button", name=name, exact=True)).to_be_hidden()
        port = first.console.rsplit(":", 1)[1]
        async with running_console(tmp_path, bridge.address, bridge.event_log, (*record, "--port", port)):
            became = "Episode 1 is lost: the console ended" if phase == "open" else "No episode yet"
            await expect(words).to_have_text(became, timeout=60_000)
            await expect(words).to_be_visible()


@pytest.mark.parametrize("resets", [False, True])
async def test_after_the_console_was_killed_the_page_says_of_a_kept_episode_what_the_recording_says(
    tmp_path: Path, chromium: Browser, monkeypatch: pytest.MonkeyPatch, resets: bool
) -> None:
    """It is killed as soon as the page asks it to keep the episode, or in the reset behind the kept one."""
    monkeypatch.setenv("LOCKSTEP_EPISODES__COUNTDOWN_SECONDS", "0")
    monkeypatch.setenv("LOCKSTEP_EPISODES__RESET_ACTION", "home" if resets else "")
    recordings = tmp_path / "recordings"
    record = ("--record", str(recordings))
    async with running_bridge("planar") as bridge, AsyncExitStack() as closing:
        async with running_console(tmp_path, bridge.address, bridge.event_log, record) as first:
            console = await closing.enter_async_context(open_console(chromium, first.operator))
            words = console.page.locator(".episode-words")
            await _take_one(console, words)
            await console.page.keyboard.press("k")
            if resets:
                await expect(words).to_have_text("Reset: home")
            await first.running.kill()
        if resets:
            await expect(words).to_have_text("The console does not answer")
        port = first.console.rsplit(":", 1)[1]
        async with running_console(tmp_path, bridge.address, bridge.event_log, (*record, "--port", port)) as second:
            later = await closing.enter_async_context(open_console(chromium, second.supervisor))
            await later.until_live()
            became = await asyncio.to_thread(_became, recordings)
            for each in (words, later.page.locator(".episode-words")):
                await expect(each).to_have_text(became, timeout=60_000)
            assert not resets or became == "Episode 1 is kept"


async def test_a_page_that_missed_that_its_episode_was_kept_is_told_by_the_next_process_of_the_console(
    tmp_path: Path, chromium: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LOCKSTEP_EPISODES__COUNTDOWN_SECONDS", "0")
    record = ("--record", str(tmp_path / "recordings"))
    async with running_bridge("planar") as bridge, AsyncExitStack() as closing:
        async with running_console(tmp_path, bridge.address, bridge.event_log, record) as first:
            network = await closing.enter_async_context(Network("micro-lan", console_url=first.console))
            console = await closing.enter_async_context(open_console(chromium, network.link(first.operator)))
            words = console.page.locator(".episode-words")
            await _take_one(console, words)
            network.outage(OUTAGE_SECONDS)
            await expect(words).to_have_text("Take 1: the console does not answer")
            headers = {"Authorization": f"Bearer {parse_link(first.supervisor).token}"}
            async with httpx.AsyncClient(base_url=first.console, headers=headers, trust_env=False) as http:
                (await http.post("/api/episode/keep", json={})).raise_for_status()
            await first.running.kill()
        port = first.console.rsplit(":", 1)[1]
        async with running_console(tmp_path, bridge.address, bridge.event_log, (*record, "--port", port)):
            await expect(words).to_have_text("Episode 1 is kept", timeout=90_000)


async def test_the_page_says_of_an_episode_that_was_kept_as_the_bridge_was_killed_what_the_recording_says(
    tmp_path: Path, chromium: Browser
) -> None:
    recordings = tmp_path / "recordings"
    async with (
        running_bridge("planar") as bridge,
        running_console(tmp_path, bridge.address, bridge.event_log, ("--record", str(recordings))) as stack,
        _taking(chromium, stack, "bridge-killed-keeping") as (bar, driver),
    ):
        await drive_on(driver, [0.2, 0.0, 0.0])
        await bar.page.keyboard.press("k")
        await bridge.process.kill()
        await expect(bar.locator(".episode-words")).to_contain_text("Episode 1 is ")
        said = await bar.locator(".episode-words").inner_text()
    assert (said.startswith("Episode 1 is kept"), _states(recordings)) in ((True, ["kept"]), (False, ["cut"]))


@needs_so101
async def test_a_policy_that_is_killed_leaves_the_robot_at_rest_and_the_episode_to_the_person(
    half_rate: None, tmp_path: Path, chromium: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, SO101[FOLDER_VARIABLE])
    monkeypatch.setenv("LOCKSTEP_EPISODES__COUNTDOWN_SECONDS", "0")
    recordings = tmp_path / "recordings"
    async with (
        running_bridge(ROBOT) as bridge,
        running_console(tmp_path, bridge.address, bridge.event_log, ("--record", str(recordings))) as stack,
        open_console(chromium, stack.operator + "&name=Ada") as ada,
        started((sys.executable, "-m", PROGRAM, await policy_link(stack), "net")) as policy,
    ):
        await policy.read(PATIENCE)
        policies, words = ada.page.get_by_role("region", name="Policies"), ada.page.locator(".episode-words")
        await ada.until_live()
        await ada.until("s.seat.mine")
        await _begin(ada, words)
        await policies.get_by_role("button", name="Give to net").click()
        await expect(policies.get_by_text("Policy net drives")).to_be_visible()
        await ada.until("s.at_rest === false")
        await policy.kill()
        await ada.until("s.at_rest === true")
        await expect(words).to_contain_text("Take 1")
        await policies.get_by_role("button", name="Take over").click()
        await ada.until("s.seat.mine && !s.armed && s.at_rest === true")
        assert await findings(ada.page) == []
        if SHOTS:
            await ada.page.screenshot(path=f"{SHOTS}/policy-killed.png")
        await ada.page.keyboard.press("y")
        await expect(ada.page.locator(".episode-count")).to_have_text("1 kept")
    assert _states(recordings) == ["kept"]


async def _begin(console: ConsolePage, words: Locator) -> None:
    await console.page.locator(".episode-task").fill("push the box")
    await console.page.locator(".episode-task").press("Enter")
    await expect(words).to_contain_text("Take 1")


async def _take_one(console: ConsolePage, words: Locator) -> None:
    """Begin an episode, and drive in it."""
    await console.until_live()
    await console.until("s.seat.mine")
    await _begin(console, words)
    await console.arm()
    await console.drive_forward()
    await console.pad.let_go()
    await console.until("s.at_rest === true")


def _became(folder: Path) -> str:
    """What the bar has to say of the only episode of all files."""
    states = []
    for path in sorted(folder.glob("*.mcap")):
        with RecordingReader(path) as reader:
            states += [each.state for each in reader.index.episodes]
    return "Episode 1 is kept" if states == ["kept"] else "Episode 1 is lost: the console ended"


async def _fill(ballast: Path, free: int) -> None:
    """Let the file grow until only so many bytes of its disk are free."""

    def grow() -> None:
        with ballast.open("ab") as file:
            size = file.tell()
            more = shutil.disk_usage(ballast.parent).free - free
            os.posix_fallocate(file.fileno(), 0, size + more)

    await asyncio.to_thread(grow)
