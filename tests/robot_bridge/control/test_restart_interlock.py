from lockstep.protocol.description import StartWarning
from lockstep.robot_bridge.control.issue_schedule import IssueSchedule
from lockstep.robot_bridge.control.restart_interlock import SILENCE, RestartInterlock

WARNING = StartWarning(seconds=1.5, axis="lamp", value=1.0)


def armed(interlock: RestartInterlock, now: float) -> None:
    interlock.executed(moving=False, spell=interlock.spell, now=now)


def test_nothing_moves_before_the_first_neutral_command() -> None:
    interlock = RestartInterlock(IssueSchedule())
    assert interlock.judge_moving(1.0, 1.0) == "not_neutral"
    armed(interlock, 1.0)
    assert interlock.judge_moving(1.0, 1.0) is None
    assert not interlock.needed


def test_a_neutral_command_of_an_earlier_spell_clears_nothing() -> None:
    interlock = RestartInterlock(IssueSchedule())
    earlier = interlock.spell
    interlock.require()
    interlock.executed(moving=False, spell=earlier, now=1.0)
    assert interlock.judge_moving(1.0, 1.0) == "not_neutral"


def test_each_cause_wants_a_feedback_that_tells_it() -> None:
    schedule = IssueSchedule()
    interlock = RestartInterlock(schedule)
    schedule.issued(1.0, answers=False)
    assert not schedule.due(1.1)
    interlock.require()
    assert schedule.due(1.1)


def test_without_a_warning_silence_asks_for_nothing() -> None:
    interlock = RestartInterlock(IssueSchedule())
    armed(interlock, 1.0)
    interlock.look(1000.0)
    assert not interlock.needed
    assert interlock.warns(1.0) == 0


def test_a_robot_that_warns_refuses_motion_for_its_seconds_and_says_how_much_is_left() -> None:
    interlock = RestartInterlock(IssueSchedule(), WARNING)
    assert interlock.warns(10.0) == 0, "nobody has armed"
    armed(interlock, 10.0)
    assert interlock.warns(10.5) == 1.0
    assert interlock.judge_moving(11.499, 11.499) == "warning"
    assert interlock.judge_moving(11.5, 11.5) is None
    assert interlock.warns(12.0) == 0


def test_further_neutral_commands_neither_lengthen_nor_shorten_the_warning() -> None:
    interlock = RestartInterlock(IssueSchedule(), WARNING)
    armed(interlock, 10.0)
    armed(interlock, 11.0)
    assert interlock.judge_moving(11.5, 11.5) is None


def test_after_two_silent_seconds_a_robot_that_warns_does_so_again() -> None:
    interlock = RestartInterlock(IssueSchedule(), WARNING)
    armed(interlock, 10.0)
    interlock.executed(moving=True, spell=interlock.spell, now=11.6)
    interlock.look(11.6 + SILENCE)
    assert not interlock.needed
    interlock.look(11.7 + SILENCE)
    assert interlock.judge_moving(11.7 + SILENCE, 11.7 + SILENCE) == "not_neutral"
    spell = interlock.spell
    interlock.look(100.0)
    assert interlock.spell == spell, "said once"


def test_a_stick_that_is_held_during_a_long_warning_drives_when_it_ends() -> None:
    interlock = RestartInterlock(IssueSchedule(50.0), StartWarning(seconds=3 * SILENCE, axis="lamp", value=1.0))
    interlock.executed(moving=False, spell=interlock.spell, now=0.0)
    for tick in range(int(3 * SILENCE / 0.02)):
        interlock.look(0.02 * tick)
        assert interlock.judge_moving(0.02 * tick, 0.02 * tick) == "warning"
    interlock.look(3 * SILENCE)
    assert interlock.judge_moving(3 * SILENCE, 3 * SILENCE) is None


def test_copies_of_a_command_that_the_warning_refused_are_no_further_commands() -> None:
    interlock = RestartInterlock(IssueSchedule(50.0), StartWarning(seconds=3 * SILENCE, axis="lamp", value=1.0))
    interlock.executed(moving=False, spell=interlock.spell, now=0.0)
    for copy in range(5):
        assert interlock.judge_moving(0.1, 0.2 + 0.3 * copy) == "warning"
    interlock.look(0.2 + SILENCE)
    assert interlock.needed


def test_a_stick_that_is_let_go_during_a_long_warning_is_silence() -> None:
    interlock = RestartInterlock(IssueSchedule(50.0), StartWarning(seconds=3 * SILENCE, axis="lamp", value=1.0))
    interlock.executed(moving=False, spell=interlock.spell, now=0.0)
    assert interlock.judge_moving(1.0, 1.0) == "warning"
    interlock.look(1.0 + SILENCE)
    assert not interlock.needed
    interlock.look(1.1 + SILENCE)
    assert interlock.needed


def test_whatever_comes_during_the_warning_ends_it() -> None:
    interlock = RestartInterlock(IssueSchedule(), WARNING)
    armed(interlock, 10.0)
    interlock.require()
    assert interlock.warns(10.1) == 0
    assert interlock.judge_moving(12.0, 12.0) == "not_neutral"
