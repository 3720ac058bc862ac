"""The page of episodes: from the recording to the rows of a dataset, and what it says when something is wrong."""

import asyncio
import json
import os
from pathlib import Path
from typing import Any

import httpx
import pyarrow.parquet as pq
import pytest
from playwright.async_api import Browser, Locator, Page, Route, expect

from lockstep.bench.browsers.chromium import open_page
from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.server.recording.episodes.edits import read_edits
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.e2e.accessibility import findings
from tests.server.recording.test_episode_export import episode, recording
from tests.support.stack import Stack, running_stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]

SHOTS = os.environ.get("EPISODE_SHOTS", "")  # directory for pictures of the page, for people to look at
SETTINGS = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0"}
MANY = 230
PROBLEMS = ["camera_missing front", "no_events"]


async def _shot(page: Page, name: str) -> None:
    if SHOTS:
        await page.screenshot(path=f"{SHOTS}/{name}.png")


def _page_of(stack: Stack, link: str) -> str:
    return f"{stack.console}/episodes#token={link.partition('#token=')[2]}"


def _rows(page: Page) -> Locator:
    return page.locator(".episode-row")


async def _settled(page: Page, count: int) -> None:
    """Until so many episodes are there, and the pictures that are seen."""
    await expect(_rows(page)).to_have_count(count, timeout=60_000)
    await expect(page.locator(".episode-row .still").first).to_have_attribute("data-state", "shown", timeout=60_000)


async def _record(driver: Console, task: str, end: str) -> None:
    await driver.episodes.start(task)
    for number in range(12):
        await drive_on(driver, [0.2 if number % 2 else -0.2, 0.0, 0.0])
    await (driver.episodes.discard() if end == "discard" else driver.episodes.keep("success"))


async def _answered(page: Page, act: Any) -> dict[str, Any]:
    """What the console said of a change; `act` makes it."""
    async with page.expect_response(lambda each: each.request.method == "POST") as answer:
        await act
    found: dict[str, Any] = await (await answer.value).json()
    return found


async def test_recorded_discarded_relabelled_trimmed_split_merged_and_exported_the_rows_match(
    tmp_path: Path, chromium: Browser
) -> None:
    recordings = tmp_path / "recordings"
    async with (
        running_stack(tmp_path, settings=SETTINGS, extra=("--record", str(recordings))) as stack,
        Console(stack.operator, video=1, audio=False, codec="H264", name="Ada") as driver,
    ):
        await driver.take_seat()
        for task, end in (("push the box", "keep"), ("push the box", "discard"), ("open the door", "keep")):
            await _record(driver, task, end)
        async with open_page(chromium, _page_of(stack, stack.operator), width=1366, height=768) as page:
            await _settled(page, 3)  # live: it is still being recorded
            await expect(page.locator(".library-count")).to_contain_text("3 episodes · 2 kept")
            await _shot(page, "live")
            door = _rows(page).filter(has_text="open the door")
            dropped = await _answered(page, door.get_by_role("button", name="Discard").click())
            assert [each["state"] for each in dropped["episodes"]] == ["kept", "discarded", "discarded"]
            await expect(door.get_by_text("Discarded")).to_be_visible()
            await page.locator(".undo-bar").get_by_role("button", name="Undo").click()
            await expect(page.locator(".library-count")).to_contain_text("2 kept")
            await _relabel_and_trim(page)
            await _split(page)
            await door.get_by_role("button", name="Discard").click()
            await expect(page.locator(".library-count")).to_contain_text("4 episodes · 2 kept")
            await _shot(page, "changed")
    (path,) = await asyncio.to_thread(lambda: list(recordings.glob("*.mcap")))
    with RecordingReader(path) as reader:
        first = reader.index.episodes[0]
    assert [first.task, first.outcome] == ["push the box", "success"], "the recording is as it was"
    assert len(read_edits(path)) == 8
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", "")
    table = pq.read_table(root / "data/chunk-000/file-000.parquet").to_pylist()
    begin, behind, middle = first.first_event + 2, first.last_event - 3, first.first_event + 6
    events = [row["lockstep.event"] for row in table]
    assert set(events) <= set(range(begin, behind))
    notes = json.loads((root / "meta" / "lockstep.json").read_text())["episodes"]
    assert [(each["first_event"], each["last_event"]) for each in notes] == [(begin, middle), (middle, behind)]
    # A busy machine leaves rows out whose picture came too late; they are counted.
    assert len(events) + sum(each["left_out"] for each in notes) == behind - begin
    assert {row["lockstep.event"] for row in table if row["episode_index"] == 0} <= set(range(begin, middle))
    assert {row["lockstep.event"] for row in table if row["episode_index"] == 1} <= set(range(middle, behind))
    assert {row["lockstep.success"] for row in table} == {0}
    assert pq.read_table(root / "meta/tasks.parquet").column("task").to_pylist() == ["shove the box"]
    assert verify_dataset(root).ok


async def _relabel_and_trim(page: Page) -> None:
    """Of the first episode: another task and outcome; two events less at the begin, three at the end."""
    box = _rows(page).filter(has_text="push the box").filter(has_text="Success")
    await box.locator(".episode-open").click()
    editor = page.get_by_role("dialog")
    for still in await editor.locator(".still").all():
        await expect(still).to_have_attribute("data-state", "shown", timeout=30_000)
    await _shot(page, "editor")
    await editor.get_by_label("Task").fill("shove the box")
    await editor.get_by_role("button", name="Failure").click()
    saved = await _answered(page, editor.get_by_role("button", name="Save").click())
    assert (saved["episodes"][0]["task"], saved["episodes"][0]["outcome"]) == ("shove the box", "failure")
    await expect(editor.get_by_role("button", name="Trim")).to_be_disabled()
    for _ in range(2):
        await editor.get_by_role("slider", name="First event").press("ArrowRight")
    last = editor.get_by_label("Last event, as a number")
    await last.fill(str(int(await last.input_value()) - 3))
    await last.press("Tab")
    trimmed = await _answered(page, editor.get_by_role("button", name="Trim").click())
    kept = trimmed["episodes"][0]
    assert kept["first_event"] == kept["first_bound"] + 2
    assert kept["last_event"] == kept["last_bound"] - 3


async def _split(page: Page) -> None:
    """Of the same episode, six events from its recorded begin on."""
    editor = page.get_by_role("dialog")
    first = int(await editor.get_by_label("First event, as a number").input_value())
    cursor = editor.get_by_label("Event to look at, as a number")
    await cursor.fill(str(first + 4))
    await cursor.press("Tab")
    split = await _answered(page, editor.get_by_role("button", name="Split at").click())
    assert [each["id"] for each in split["episodes"][:2]] == ["edit-5a", "edit-5b"]
    await expect(editor.locator(".editor-history")).to_contain_text("split at event")
    await _shot(page, "split")
    merged = await _answered(page, editor.get_by_role("button", name="Merge with the next").click())
    whole, halves = merged["episodes"][0], split["episodes"][:2]
    assert (whole["first_event"], whole["last_event"]) == (halves[0]["first_event"], halves[1]["last_event"])
    assert len(merged["episodes"]) == len(split["episodes"]) - 1
    await _shot(page, "merged")
    await editor.get_by_role("button", name="Close").click()
    again = await _answered(page, page.locator(".undo-bar").get_by_role("button", name="Undo").click())
    assert again["episodes"][:2] == halves


def _folder(directory: Path) -> Path:
    """Recordings with many episodes: of two tasks, of all states, some with problems."""
    directory.mkdir()
    found = []
    for number in range(MANY):
        first = 10 + 4 * number
        state = "discarded" if number % 5 == 4 else "cut" if number % 23 == 22 else "kept"
        outcome = {"outcome": "success" if number % 3 else "failure"} if state == "kept" else {}
        more = {"number": number + 1, "task": "pour" if number % 2 else "put the red cube into the bowl", **outcome}
        found.append(episode(f"e{number}", "start", first, first, task=more["task"]))
        found.append(
            episode(
                f"e{number}",
                state,
                first,
                first + 3,
                task=more["task"],
                outcome=outcome.get("outcome", ""),
                drivers=["Ada"] if number % 4 else ["Bo"],
                problems=PROBLEMS if number % 7 == 6 else [],
                why="link_down" if state == "cut" else "",
            )
        )
    recording(directory / "long.mcap", *found, events=10 + 4 * MANY + 5)
    kept = (episode("a", "start", 10, 10, task="wipe"), episode("a", "kept", 10, 60, task="wipe", outcome="success"))
    recording(directory / "short.mcap", *kept, events=80)
    (directory / "damaged.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\0" * 99)
    return directory


def _settings(folder: Path) -> dict[str, str]:
    names = {"DIRECTORY": str(folder), "AGE_DAYS": "100000", "FREE_BYTES": "0"}
    return {f"LOCKSTEP_RECORDING__{name}": value for name, value in names.items()}


async def _filtered(page: Page) -> list[str]:
    """By everything that there is; what axe-core found meanwhile."""
    await page.get_by_label("Outcome").select_option("failure")
    await page.get_by_label("Quality").select_option("problems")
    await page.get_by_label("Driver").select_option("Bo")
    await expect(_rows(page).first).to_contain_text("no pictures of front")
    assert all("Bo" in text for text in await _rows(page).all_inner_texts())
    found = await findings(page)
    await page.get_by_role("searchbox").fill("nothing like this")
    await page.get_by_text("No episode is like this").wait_for()
    found += await findings(page)
    await _shot(page, "none-like-this")
    await page.get_by_role("button", name="Show all").click()
    await page.get_by_label("Order").select_option("longest")
    await expect(_rows(page).first).to_contain_text("wipe")
    await page.get_by_label("Kept or not").select_option("discarded")
    await expect(page.locator(".library-count")).to_contain_text(f"{MANY // 5} of {MANY + 1} episodes · 0 kept")
    await page.get_by_label("Kept or not").select_option("all")
    return found


async def test_hundreds_of_episodes_are_listed_filtered_and_ordered_and_axe_finds_nothing_in_any_state(
    tmp_path: Path, chromium: Browser
) -> None:
    folder = await asyncio.to_thread(_folder, tmp_path / "recordings")
    async with running_stack(tmp_path, settings=_settings(folder)) as stack:
        async with open_page(chromium, _page_of(stack, stack.supervisor), width=1366, height=768) as page:
            await _settled(page, 100)
            await expect(page.get_by_text("1 file cannot be read.")).to_be_visible()
            found = await findings(page)
            await _shot(page, "long")
            await page.get_by_role("button", name="Show 100 more").click()
            await expect(_rows(page)).to_have_count(200)
            found += await _filtered(page)
            await _rows(page).filter(has_text="wipe").locator(".episode-open").click()
            await page.get_by_role("dialog").locator(".still[data-state=shown]").nth(2).wait_for()
            found += await findings(page)
            await page.keyboard.press("Escape")
            await expect(page.get_by_role("dialog")).to_have_count(0)
            assert await page.evaluate("document.activeElement.className") == "episode-open"
            found += await _in_trouble(page)
            assert found == []
        async with open_page(chromium, _page_of(stack, stack.observer), width=390, height=844) as page:
            await _on_a_phone(page)


async def _in_trouble(page: Page) -> list[str]:
    """The console does not answer any more, and then does again; somebody else was faster."""

    async def nothing(route: Route) -> None:
        await route.abort()

    await page.route("**/api/**", nothing)
    await expect(page.locator(".library-trouble")).to_contain_text("The console does not answer", timeout=30_000)
    await expect(_rows(page).first).to_be_visible()
    found = await findings(page)
    await _shot(page, "disconnected")
    await page.unroute("**/api/**", nothing)
    await expect(page.locator(".library-trouble")).to_be_hidden(timeout=30_000)
    token = (await page.evaluate("location.hash")).partition("token=")[2].partition("&")[0]
    address = await page.evaluate("new URL('./api/recordings/short/episodes', location.href).href")
    await page.route("**/api/episodes*", nothing)  # so that this page learns nothing of it
    async with httpx.AsyncClient(trust_env=False, headers={"Authorization": f"Bearer {token}"}) as http:
        body = {"revision": 0, "episode": "a", "task": "somebody else's"}
        assert (await http.post(address, json=body)).status_code == 200
    wipe = _rows(page).filter(has_text="wipe")
    await wipe.get_by_role("button", name="Discard").click()
    await expect(page.locator(".library-trouble")).to_contain_text("Somebody else has changed the episodes")
    await expect(_rows(page).filter(has_text="somebody else's")).to_be_visible()
    await page.unroute("**/api/episodes*", nothing)
    return found


async def _on_a_phone(page: Page) -> None:
    """Somebody who only watches."""
    await _settled(page, 100)
    assert await page.locator(".episode-tools button").count() == 0
    assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    await _shot(page, "phone")
    found = await findings(page)
    await page.get_by_text("Filter and order").click()
    await page.get_by_label("Order").select_option("longest")
    await _shot(page, "phone-filter")
    await _rows(page).first.locator(".episode-open").click()
    editor = page.get_by_role("dialog")
    await editor.locator(".still[data-state=shown]").nth(2).wait_for()
    await _shot(page, "phone-editor")
    assert await editor.get_by_role("button", name="Trim").count() == 0
    assert await editor.get_by_role("slider").count() == 1
    assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    found += await findings(page)
    assert found == []


async def test_without_recordings_and_without_a_link_the_page_says_what_to_do(
    tmp_path: Path, chromium: Browser
) -> None:
    async with running_stack(tmp_path) as stack:
        async with open_page(chromium, _page_of(stack, stack.operator), width=1366, height=768) as page:
            await page.get_by_text("There are no episodes yet").wait_for()
            await _shot(page, "empty")
            assert await findings(page) == []
        async with open_page(chromium, f"{stack.console}/episodes") as page:
            await page.get_by_text("This link does not say who you are").wait_for()
            assert await findings(page) == []
        async with open_page(chromium, f"{stack.console}/episodes#token=wrong") as page:
            await page.get_by_text("Your own link is no longer valid").wait_for()
            assert await findings(page) == []
