"""What breaks comes back by itself, without a reload, at the event that then holds."""

import os
import signal
from pathlib import Path

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import RB
from lockstep.client import Console
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.browser


async def _nothing_wrong(console: ConsolePage) -> None:
    """Still the same page, and nothing was rendered against the rule."""
    assert await console.page.evaluate("window.notReloaded")
    assert all(stream["violations"] == 0 for stream in (await console.stats())["streams"].values())


async def test_a_killed_bridge_is_shown_and_the_page_goes_on_with_its_next_epoch(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.operator) as console:
        await console.until_live()
        async with console.driving():
            await console.until("s.event > 10")
        epoch = (await console.stats())["epoch"]
        await console.page.evaluate("window.notReloaded = true")
        os.kill(own_stack.bridge_pid(), signal.SIGKILL)
        await console.until("!s.armed")
        await console.pad.let_go()
        await console.until(f"s.connected && s.epoch !== {epoch!r} && s.streams.overview?.rendered > 3", 60)
        assert (await console.stats())["event"] < 10, "references start anew with the epoch"
        await console.until("s.stop.stopped && s.stop.reason.includes('did not shut down cleanly')")
        async with Console(own_stack.supervisor, video=False, audio=False) as supervisor:
            await supervisor.reset()
        await console.until("!s.stop.stopped && s.seat && s.seat.mine")
        await console.arm()
        await console.drive_forward()
        await _nothing_wrong(console)


# Read by every Python that starts: the bridge's planar robot hangs once in a tick, where there is a file, for ever.
HANGS_ONCE = """
import sys
if "lockstep.robot_bridge" in sys.orig_argv:
    import os, time
    from lockstep.robot_bridge.watchdog import liveness
    from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
    liveness.LIMIT = 1.0
    tick = PlanarRobot.tick
    def hang(robot):
        if os.path.exists(HANG):
            os.unlink(HANG)
            time.sleep(600)
        tick(robot)
    PlanarRobot.tick = hang
"""


async def test_a_bridge_that_hangs_is_started_again_stopped_and_the_page_says_that_it_hung(
    tmp_path: Path, chromium: Browser
) -> None:
    hang = tmp_path / "hang"
    (tmp_path / "sitecustomize.py").write_text(f"HANG = {str(hang)!r}\n{HANGS_ONCE}")
    async with (
        running_stack(tmp_path, settings={"PYTHONPATH": str(tmp_path)}) as stack,
        open_console(chromium, stack.operator) as console,
    ):
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        epoch = (await console.stats())["epoch"]
        hang.touch()
        await console.until("!s.armed")
        await console.pad.let_go()
        await console.until(f"s.connected && s.epoch !== {epoch!r}", 60)
        await console.until("s.stop.stopped && s.stop.reason === 'The robot bridge hung: no control tick for 1 s'")
        await console.page.get_by_text("The robot bridge hung").first.wait_for()
        async with Console(stack.supervisor, video=False, audio=False) as supervisor:
            await supervisor.reset()
        await console.until("!s.stop.stopped && s.seat && s.seat.mine")
        await console.arm()
        await console.drive_forward()


async def test_a_frozen_bridge_counts_as_a_dead_link_and_resumes_in_the_same_epoch(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        with own_stack.frozen_bridge():
            await console.until("!s.armed")
            await console.page.get_by_text("Robot unreachable").first.wait_for()
        await console.pad.let_go()
        await console.until("s.connected && s.at_rest === true && s.seat && s.seat.mine", 60)
        await console.arm()
        await console.drive_forward()


async def test_a_restarted_console_is_found_again_without_a_reload(tmp_path: Path, chromium: Browser) -> None:
    async with running_stack(tmp_path) as first:
        port = int(first.console.rsplit(":", 1)[1])
        page = open_console(chromium, first.operator)
        console = await page.__aenter__()
        await console.until_live()
    try:
        await console.until("!s.connected")
        await console.page.evaluate("window.notReloaded = true")
        async with running_stack(tmp_path, port=port):
            await console.until_live()
            await console.arm()
            await console.drive_forward()
            await _nothing_wrong(console)
            await console.pad.press(RB, False)
    finally:
        await page.__aexit__(None, None, None)
