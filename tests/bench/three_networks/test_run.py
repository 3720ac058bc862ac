"""A robot, a console and a page behind three routers: paired by code, and driven from the page, in short."""

import pytest

from lockstep.bench.three_networks.run import run
from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.namespace.tun import open_tun

CUT = 2.0  # s


@pytest.fixture(autouse=True)
def _namespaces() -> None:
    try:
        open_tun("10.0.1.2").close()
    except NamespacesUnavailable as reason:
        pytest.skip(str(reason))


@pytest.mark.browser
@pytest.mark.timeout(300)
async def test_a_robot_behind_nat_pairs_by_code_and_is_driven_from_a_page_in_a_third_network() -> None:
    said: list[str] = []
    found = await run("perfect", "perfect", 0.0, 1, said.append, settle=0.0)
    assert said == ["the console has given a code", "the page has driven"]
    # However short the drive is: it begins when the page sees the robot move.
    assert found["moving_commands_executed"] > 0
    assert {stream["violations"] for stream in found["after"]["streams"].values()} == {0}


@pytest.mark.browser
@pytest.mark.timeout(300)
async def test_the_page_drives_again_after_the_robot_behind_nat_was_cut_off() -> None:
    said: list[str] = []
    found = await run("perfect", "perfect", CUT, 1, said.append, cuts=1, settle=0.0)
    assert len(said) == 3
    assert said[1].startswith("cut 1: driven again")
    assert found["rest_ms_worst"] < CUT * 1000, "it rested by itself"
    assert found["nothing_late"] == 1
    assert found["back_ms_worst"] is not None
    assert {stream["violations"] for stream in found["after"]["streams"].values()} == {0}
