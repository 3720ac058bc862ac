"""How long the ticks may be away, and what counts as too long."""

import msgspec
import pytest

from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.robot_bridge.watchdog.stall import LONG, StallGauge, watchdog_seconds

UNSET = msgspec.structs.replace(DESCRIPTION, watchdog=None)


@pytest.mark.parametrize(
    ("hold", "tick", "seconds"), [(0.5, 0.004, 0.1), (0.5, 0.05, 0.15), (0.16, 0.004, 0.08), (0.1, 0.04, 0.05)]
)
def test_unless_set_it_is_three_ticks_or_a_tenth_of_a_second_and_always_less_than_hold(
    hold: float, tick: float, seconds: float
) -> None:
    description = msgspec.structs.replace(UNSET, hold=hold)
    assert watchdog_seconds(description, tick) == pytest.approx(seconds)


def test_the_description_may_set_it() -> None:
    assert watchdog_seconds(msgspec.structs.replace(UNSET, watchdog=0.2), 0.004) == 0.2


@pytest.mark.parametrize(
    ("watchdog", "hold", "named"), [(0.2, 0.5, "watchdog"), (0.1, 0.5, "watchdog"), (None, 0.4, "half of hold")]
)
def test_a_watchdog_that_would_act_between_two_ticks_is_refused(
    watchdog: float | None, hold: float, named: str
) -> None:
    with pytest.raises(DescriptionError, match=named):
        watchdog_seconds(msgspec.structs.replace(UNSET, watchdog=watchdog, hold=hold), 0.2)


@pytest.mark.parametrize("seconds", [0.0, -1.0, DESCRIPTION.hold, 2.0, float("nan")])
def test_a_description_whose_watchdog_is_not_less_than_hold_is_refused(seconds: float) -> None:
    with pytest.raises(DescriptionError, match="watchdog"):
        check_description(msgspec.structs.replace(DESCRIPTION, watchdog=seconds))


def test_a_gap_counts_when_the_robot_moves_and_a_long_one_in_any_case() -> None:
    gauge = StallGauge(0.1, 0.0)
    assert gauge.tick(0.09, True) is None
    assert gauge.tick(0.20, True) == pytest.approx(0.11)
    assert gauge.tick(0.40, False) is None
    assert gauge.tick(0.40 + LONG + 0.01, False) == pytest.approx(LONG + 0.01)
