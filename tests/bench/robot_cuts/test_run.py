"""The robot's network is cut, in a namespace of its own; and what the figures say of findings."""

import pytest

from lockstep.bench.experiment.judge.outage_judge import Cut, Finding
from lockstep.bench.robot_cuts.cuts import figures, with_silence
from lockstep.bench.robot_cuts.run import Way, run_cuts
from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.namespace.namespaces import ROBOT_ADDRESS
from lockstep.emulator.namespace.tun import open_tun


def finding(**parts: float | None) -> Finding:
    good = {"rest_seconds": 0.2, "hold": 0.3, "oldest_answer": 0.1, "oldest_intention": 0.1, "max_event_age": 2.0}
    return Finding(**{**good, "control_seconds": 0.5, **parts})  # type: ignore[arg-type]  # the names are its fields


def test_the_figures_are_the_worst_of_all_cuts_and_count_the_good_ones() -> None:
    bad = [finding(rest_seconds=0.4), finding(control_seconds=2.5), finding(oldest_answer=2.1)]
    found = figures([finding(), *bad])
    assert found["cuts"] == 4
    assert (found["rest_ms_worst"], found["back_ms_worst"], found["oldest_answer_ms"]) == (400.0, 2500.0, 2100.0)
    assert found["own_outage_ms"] == [0.0] * 4
    assert [found[name] for name in ("rested_within_hold", "back_within_2_s", "nothing_late")] == [3, 3, 3]


def test_a_robot_that_never_rested_or_came_back_has_no_worst_figure() -> None:
    found = figures([finding(), finding(rest_seconds=None, control_seconds=None)])
    assert (found["rest_ms_worst"], found["back_ms_worst"]) == (None, None)
    assert (found["rested_within_hold"], found["back_within_2_s"]) == (1, 1)


def test_the_age_of_intentions_is_unknown_where_none_were_written_down() -> None:
    assert figures([finding(oldest_intention=None)])["oldest_intention_ms"] is None
    assert figures([finding(oldest_intention=None), finding()])["oldest_intention_ms"] == 100.0


def test_outages_of_the_path_s_own_until_control_is_back_are_told() -> None:
    cut = Cut(100.0, 110.0, held=False)
    found = with_silence(finding(control_seconds=0.8), cut, lambda began, ended: round(ended - began, 6) / 2)
    assert figures([found])["own_outage_ms"] == [400.0]
    never = finding(control_seconds=None)
    assert with_silence(never, cut, lambda _began, _ended: 1.0) == never


CUT = 2.0  # s


@pytest.mark.timeout(120)
@pytest.mark.parametrize("way", ["reached", "dial-in", "behind-nat"])
async def test_a_robot_rests_while_it_is_cut_off_and_is_driven_again(way: Way) -> None:
    try:
        open_tun(ROBOT_ADDRESS).close()
    except NamespacesUnavailable as reason:
        pytest.skip(str(reason))
    said: list[str] = []
    (found,) = await run_cuts(way, 1, CUT, 1, said.append, network="robot-512k")
    assert found.rest_seconds is not None
    assert found.rest_seconds < CUT, "it rested by itself"
    assert found.nothing_queued_executed
    assert found.control_seconds is not None
    assert said[0].startswith("cut 1: driven again")
