"""Live charts: shown beside the pictures while driving, frozen, and saved with one key as CSV and PNG."""

import csv
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

DRAWN = "({ spans }) => 'between_ms' in spans && 'draw_ms' in spans"


async def test_one_key_saves_what_the_charts_show_while_the_operator_drives(
    stack: Stack, chromium: Browser, tmp_path: Path
) -> None:
    async with open_console(chromium, stack.operator) as console:
        page = console.page
        await console.until_live()
        async with console.driving():
            await page.keyboard.press("c")
            await expect(page.locator(".chart")).to_have_count(4)
            start = (await console.stats())["event"]
            await console.until(f"s.event > {start + 40}")  # a row is up to 0.1 s old
            await console.until("s.driving")  # charts do not stand in the operator's way
        await expect(page.locator("[data-chart=gap] .chart-figure").first).not_to_have_text("–")
        async with (
            page.expect_download(lambda download: download.suggested_filename.endswith(".png")) as picture,
            page.expect_download(lambda download: download.suggested_filename.endswith(".csv")) as table,
        ):
            await page.keyboard.press("x")
        await (await table.value).save_as(tmp_path / "charts.csv")
        await (await picture.value).save_as(tmp_path / "charts.png")
        await page.keyboard.press("f")
        await expect(page.locator(".charts")).to_have_attribute("data-frozen", "true")
        await page.keyboard.press("c")
        await expect(page.locator(".charts")).to_be_hidden()
        await expect(page.locator(".chart")).to_have_count(0)
    rows = list(csv.DictReader((tmp_path / "charts.csv").read_text().splitlines()))
    events = [int(row["event"]) for row in rows if row["event"]]
    assert events == sorted(events)
    assert events[-1] > start + 30
    gaps = [abs(int(row["overview_gap"])) for row in rows if row["overview_gap"]]
    assert gaps
    assert max(gaps) <= 4
    assert {row["epoch"] for row in rows if row["event"]} == {rows[-1]["epoch"]}
    assert (tmp_path / "charts.png").read_bytes().startswith(b"\x89PNG")


async def test_on_a_small_screen_the_charts_stand_over_the_pictures_and_nobody_drives_behind_them(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator, width=390, height=844, touch=True) as console:
        page = console.page
        await console.until_live()
        await console.arm()
        await page.get_by_role("button", name="Details").click()
        await page.locator(".details-extras").get_by_role("button", name="Charts").click()
        await expect(page.locator(".chart")).to_have_count(4)
        await console.until("!s.armed")
        await expect(page.get_by_role("button", name="STOP")).to_be_visible()
        await page.get_by_role("button", name="10 min").click()
        await expect(page.get_by_role("button", name="10 min")).to_have_attribute("aria-pressed", "true")


async def test_the_charts_show_where_each_millisecond_goes(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        page = console.page
        await console.until_live()
        await page.keyboard.press("c")
        picture, command = page.locator("[data-chart=picture_way]"), page.locator("[data-chart=command_way]")
        await expect(picture).to_have_attribute("data-empty", "false")
        await expect(command).to_have_attribute("data-empty", "true")
        await expect(picture.locator(".way-part[data-clock=between]")).to_have_count(0)
        async with console.driving():
            await expect(command).to_have_attribute("data-empty", "false", timeout=20_000)
            for clock in ("bridge", "console", "between", "page"):
                for way in (picture, command):
                    await expect(way.locator(f".way-part[data-clock={clock}]").first).to_be_attached(timeout=20_000)
        # A picture that is on its way to the canvas has no time of drawing yet.
        await console.until(f"window.lockstep.traces().pictures.some({DRAWN})")
        traces = await page.evaluate("window.lockstep.traces()")
    for traced in traces["commands"]:
        inside = [ms for name, ms in traced["spans"].items() if name not in ("input_ms", "take_ms")]
        assert sum(inside) >= traced["totalMs"] - 0.01  # the remainder is what the spans leave of the round, or 0
    drawn = [each["spans"] for each in traces["pictures"] if {"between_ms", "draw_ms"} <= each["spans"].keys()]
    assert drawn
    assert all({"capture_ms", "encode_ms", "send_ms", "gate_ms"} <= each.keys() for each in drawn)
