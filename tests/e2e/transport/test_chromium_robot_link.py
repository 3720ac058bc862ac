"""A supervisor pairs a robot that dials in, sees it come, and forgets it."""

import asyncio
import os
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from lockstep.bench.browsers.chromium import open_page
from lockstep.bench.browsers.console_page import open_console
from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import LOCKSTEP
from tests.e2e.overview import until
from tests.support.stack import running_console

pytestmark = pytest.mark.browser


async def _photo(page: Page, name: str) -> None:
    """For people who look at it."""
    folder = os.environ.get("LOCKSTEP_SCREENSHOTS", "")
    if folder:
        await page.screenshot(path=Path(folder) / f"{name}.png")


def _command(shown: str, directory: Path) -> list[str]:
    """What the page says to type, for the planar robot of this checkout."""
    program, robot, _, *rest = shown.split(" ")
    assert (program, robot) == ("lockstep", "robot")
    return [LOCKSTEP, "robot", "planar", "--json", *rest, "--state-dir", str(directory / "robot")]


@pytest.mark.parametrize("width", [1280, 390])
async def test_a_supervisor_pairs_a_robot_drives_it_and_forgets_it(
    tmp_path: Path, chromium: Browser, width: int
) -> None:
    height = 800
    async with (
        running_console(tmp_path, "dial-in", tmp_path / "events.jsonl") as stack,
        open_console(chromium, stack.supervisor, pad=False, width=width, height=height) as console,
    ):
        page = console.page
        dialogue = page.get_by_role("dialog")
        await expect(dialogue).to_contain_text("No robot is paired")
        await _photo(page, f"unpaired-{width}")
        (tmp_path / "key").write_text("k" * 40)
        (tmp_path / "key").chmod(0o600)
        dials = ("--console", stack.console.replace("http", "ws", 1), "--console-key-file", str(tmp_path / "key"))
        async with running_process(LOCKSTEP, "robot", "planar", "--json", *dials):
            robots = dialogue.get_by_role("list", name="Robots that wait")
            await expect(robots).to_contain_text(
                "A robot waits at 127.0.0.1: it has no key of this console. Make a code and pair it."
            )
            await _photo(page, f"unknown-{width}")
        await dialogue.get_by_role("button", name="Pair a robot").click()
        await expect(dialogue).to_contain_text("Waits for the robot")
        shown = await dialogue.get_by_label("Command for the robot's computer").input_value()
        code = await dialogue.get_by_label("Pairing code").inner_text()
        assert shown.endswith(f"--pair {code}")
        await expect(dialogue).to_contain_text("127.0.0.1 in this command is the robot's own computer")
        await _photo(page, f"waiting-{width}")
        wrong = _command(shown.replace(code, f"{code[:2]}-22222-22222"), tmp_path)
        assert await (await asyncio.create_subprocess_exec(*wrong)).wait() == 2
        await expect(dialogue).to_contain_text("A robot was refused: its code was not this one.")
        await expect(dialogue).to_contain_text("4 tries left")
        await _photo(page, f"refused-{width}")
        async with running_process(*_command(shown, tmp_path)):
            await expect(dialogue).to_contain_text("planar is connected")
            await expect(dialogue).to_contain_text("Paired by supervisor")
            await expect(robots).to_have_count(0)
            await _photo(page, f"connected-{width}")
            await dialogue.get_by_role("button", name="Close").click()
            await console.until("s.connected && s.event !== null")
            if width < 1000:
                await page.get_by_role("button", name="Details").click()
            await page.get_by_role("tab", name="People").click()
            await page.get_by_role("button", name="Robot link…").click()
            await dialogue.get_by_role("button", name="Forget").click()
            await dialogue.get_by_role("button", name="Really?").click()
            await expect(dialogue).to_contain_text("No robot is paired")
            await expect(dialogue.get_by_role("button", name="Pair a robot")).to_be_visible()
            await _photo(page, f"forgotten-{width}")


async def test_who_does_not_supervise_is_told_to_wait_for_the_robot(tmp_path: Path, chromium: Browser) -> None:
    async with (
        running_console(tmp_path, "dial-in", tmp_path / "events.jsonl") as stack,
        open_console(chromium, stack.operator, pad=False) as console,
    ):
        await expect(console.page.get_by_text("no robot is paired").first).to_be_visible()
        await expect(console.page.get_by_role("button", name="Robot link…")).to_have_count(0)
        await _photo(console.page, "operator")


async def test_the_overview_of_a_fleet_pairs_each_robot_by_itself(tmp_path: Path, chromium: Browser) -> None:
    right = ("--robot", "right=dial-in")
    async with (
        running_console(tmp_path, "left=dial-in", tmp_path / "events.jsonl", right) as stack,
        open_page(chromium, stack.supervisor, width=1280, height=800, pad=False) as page,
    ):
        await page.get_by_role("button", name="Robot links").click()
        left, other = page.get_by_role("region", name="left"), page.get_by_role("region", name="right")
        await left.get_by_role("button", name="Pair a robot").click()
        await expect(left).to_contain_text("Waits for the robot")
        await expect(other).to_contain_text("No robot is paired")
        await _photo(page, "fleet-waiting")
        shown = await left.get_by_label("Command for the robot's computer").input_value()
        assert "/robots/left --pair " in shown
        async with running_process(*_command(shown, tmp_path)):
            await expect(left).to_contain_text("planar is connected")
            await expect(other).to_contain_text("No robot is paired")
            await _photo(page, "fleet-connected")
            await page.get_by_role("button", name="Close").click()
            await until(page, "r.left.state === 'free'")
        swapped = [each.replace("/robots/left", "/robots/right") for each in _command(shown, tmp_path)]
        process = await asyncio.create_subprocess_exec(*swapped[:-4], *swapped[-2:], stderr=asyncio.subprocess.PIPE)
        assert process.stderr is not None
        try:
            while b"robot_unknown" not in await process.stderr.readline():
                pass
        finally:
            process.terminate()
            await process.communicate()
