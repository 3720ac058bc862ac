"""What limits the robot is shown where the operator looks."""

from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from lockstep.bench.browsers.pad import LEFT_X, LEFT_Y, RB
from tests.support.stack import running_stack

pytestmark = pytest.mark.browser


async def test_a_geofence_and_the_speed_cap_are_shown_and_the_consoles_cap_cannot_be_turned_off(
    tmp_path: Path, chromium: Browser
) -> None:
    async with (
        running_stack(tmp_path, extra=("--speed-cap", "on")) as stack,
        open_console(chromium, stack.operator) as console,
    ):
        await console.until_live()
        switch = console.page.get_by_role("switch", name="Slow down with delay")
        await expect(switch).to_have_attribute("aria-checked", "true")
        await expect(switch).to_be_disabled()
        async with console.driving({LEFT_Y: -0.9, LEFT_X: 0.55}):
            await console.until("s.driving && s.limits.includes('charger')")
            strip = console.page.get_by_label("Limits of the robot")
            await strip.get_by_text("Keep out: Charging corner").wait_for()
        await console.pad.tilt(LEFT_X, 0)
        await console.pad.tilt(LEFT_Y, 1)
        await console.until("s.limits.length === 0")
        await console.pad.press(RB, False)
        await console.until("!s.driving && s.at_rest === true")
