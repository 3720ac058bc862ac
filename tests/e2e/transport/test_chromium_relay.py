"""Chromium behind a NAT that lets nothing through: everything goes through a real TURN server, or not at all."""

from pathlib import Path

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import open_console
from lockstep.bench.browsers.pad import RB
from tests.support.stack import running_stack
from tests.support.turn_server import TURN_SECRET, TurnServer, running_turn_server

pytestmark = pytest.mark.browser

# The page keeps its connection to itself; the test looks at every one that is made.
KEEP_CONNECTIONS = """
window.connections = [];
window.RTCPeerConnection = class extends RTCPeerConnection {
  constructor(...given) { super(...given); window.connections.push(this); }
};
"""
SELECTED_PAIR = """async () => {
  const stats = await window.connections.at(-1).getStats();
  for (const each of stats.values())
    if (each.type === "transport" && each.selectedCandidatePairId) {
      const pair = stats.get(each.selectedCandidatePairId);
      return [stats.get(pair.localCandidateId).candidateType, pair.bytesReceived];
    }
  return null;
}"""
# As if the page had slept past the credentials' end: the same name and password, an hour too old.
EXPIRE = """
const { get } = Headers.prototype;
Headers.prototype.get = function (name) {
  const said = get.call(this, name);
  const past = Math.floor(Date.now() / 1000) - 3600;
  return name === "Link" ? said?.replaceAll(/username="\\d+:/g, `username="${past}:`) ?? null : said;
};
"""

NOTHING_WRONG = "Object.values(s.streams).every((each) => each.violations === 0)"


def _turn_options(turn: TurnServer) -> tuple[str, ...]:
    return ("--turn", turn.uri, "--turn-secret", TURN_SECRET, "--ice-host", "127.0.0.1")


async def test_pictures_pass_the_gate_and_the_robot_is_driven_through_the_relay(
    tmp_path: Path, chromium: Browser
) -> None:
    async with (
        running_turn_server(tmp_path) as turn,
        running_stack(tmp_path, extra=_turn_options(turn)) as stack,
        open_console(chromium, "about:blank") as page,
    ):
        await page.page.add_init_script(KEEP_CONNECTIONS)
        await page.page.goto(f"{stack.operator}&relay=only")
        await page.until_live()
        kind, octets = await page.page.evaluate(SELECTED_PAIR)
        assert kind == "relay"
        assert octets > 0
        before = (await page.stats())["event"]
        async with page.driving():
            await page.until(f"s.event > {before} + 20 && {NOTHING_WRONG}")
        await page.pad.press(RB, False)
        await page.until("s.at_rest")
        assert (await page.page.evaluate(SELECTED_PAIR))[0] == "relay"


async def test_without_credentials_that_are_still_good_there_is_no_way_and_the_page_says_so(
    tmp_path: Path, chromium: Browser
) -> None:
    async with (
        running_turn_server(tmp_path) as turn,
        running_stack(tmp_path, extra=_turn_options(turn)) as stack,
        open_console(chromium, "about:blank") as page,
    ):
        await page.page.add_init_script(EXPIRE)
        await page.page.goto(f"{stack.operator}&relay=only")
        await page.page.get_by_text("No path through the TURN server").first.wait_for(timeout=30_000)
        assert not (await page.stats())["connected"]
        assert turn.says("401")
