"""A robot, a console and a page behind three routers: paired by code, and driven from the page, in short."""

import pytest

from lockstep.bench.three_networks.run import run
from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.namespace.tun import open_tun


@pytest.mark.browser
@pytest.mark.timeout(300)
async def test_a_robot_behind_nat_pairs_by_code_and_is_driven_from_a_page_in_a_third_network() -> None:
    try:
        open_tun("10.0.1.2").close()
    except NamespacesUnavailable as reason:
        pytest.skip(str(reason))
    said: list[str] = []
    found = await run("perfect", "perfect", 0.0, 1, said.append, settle=0.0)
    assert said == ["the console has given a code", "the page has driven"]
    # However short the drive is: it begins when the page sees the robot move.
    assert found["moving_commands_executed"] > 0
    assert {stream["violations"] for stream in found["after"]["streams"].values()} == {0}
