from collections.abc import Callable

import pytest

from lockstep.robot_bridge.control.issue_schedule import IssueSchedule
from lockstep.robot_bridge.control.restart_interlock import RestartInterlock
from lockstep.robot_bridge.stop.stop_core import StopCore
from lockstep.robot_bridge.stop.stop_latch import ResetTaken, StopLatch


class Rig:
    def __init__(self, *, keeps: bool = False) -> None:
        self.schedule = IssueSchedule()
        self.interlock = RestartInterlock(self.schedule)
        self.stops = StopCore(self.interlock, self.schedule)
        self.stops.latch = StopLatch(keeps=keeps)

    def settle(self, now: float) -> int:
        """Show the state; return the interlock's spell."""
        self.schedule.issued(now, answers=False)
        self.stops.latch.shown(self.stops.state, now)
        return self.interlock.spell


CHANGES: tuple[Callable[[StopCore], object], ...] = (
    lambda stops: stops.stop("", "Ada", "smoke", 10.0),
    lambda stops: stops.lock_out("key switch", 10.0),
)


@pytest.mark.parametrize("change", CHANGES)
def test_a_stop_needs_a_neutral_command_and_a_feedback(change: Callable[[StopCore], object]) -> None:
    rig = Rig()
    spell = rig.settle(10.0)
    change(rig.stops)
    assert rig.stops.state.stopped
    assert rig.interlock.spell > spell
    assert rig.schedule.due(10.0)


def test_a_repeated_press_needs_nothing() -> None:
    rig = Rig()
    rig.stops.stop("ab12", "Ada", "", 10.0)
    spell = rig.settle(10.0)
    assert not rig.stops.stop("ab12", "Ada", "", 10.1).is_new
    assert rig.interlock.spell == spell
    assert not rig.schedule.due(10.1)


def test_the_end_of_a_lock_out_needs_a_neutral_command_and_a_second_one_none() -> None:
    rig = Rig()
    rig.stops.lock_out("key switch", 10.0)
    spell = rig.settle(10.0)
    assert rig.stops.let_in()
    assert rig.interlock.spell == spell + 1
    assert not rig.stops.let_in()
    assert rig.interlock.spell == spell + 1


@pytest.mark.parametrize("keeps", [False, True])
def test_a_reset_needs_a_neutral_command_once_it_is_taken(keeps: bool) -> None:
    rig = Rig(keeps=keeps)
    number = rig.stops.stop("", "Ada", "", 10.0).number
    spell = rig.settle(10.0)
    outcome = rig.stops.reset(number, 11.1)
    if keeps:
        assert rig.interlock.spell == spell, "it waits for the disk"
        assert not rig.schedule.due(10.1)
        assert rig.stops.written(rig.stops.latch.version) == ResetTaken(number)
    else:
        assert outcome == ResetTaken(number)
    assert rig.interlock.spell == spell + 1
    assert rig.schedule.due(10.1)


def test_a_record_on_the_disk_is_told_and_moves_nothing() -> None:
    rig = Rig(keeps=True)
    rig.stops.stop("", "Ada", "", 10.0)
    spell = rig.settle(10.0)
    assert rig.stops.written(rig.stops.latch.version) is None
    assert rig.stops.state.kept
    assert rig.schedule.due(10.1)
    assert rig.interlock.spell == spell
