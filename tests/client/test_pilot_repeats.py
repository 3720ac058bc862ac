"""When the command in flight is repeated, and what is learnt from its answer."""

from lockstep.client.control.command_sender import ECHO, ECHOES, LOSSY_SPELL, SALVO, SALVO_SPACING
from lockstep.client.control.repeat_timer import FLOOR, INITIAL
from tests.client.helpers import feedback
from tests.client.pilots import FAST, commands, flying, new_pilot


def test_a_repeat_gives_no_sample_of_the_round_trip() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.due(INITIAL)
    pilot.feedback(feedback(2), INITIAL + 0.09)
    assert pilot.timer.round_trip is None
    assert list(pilot.samples) == [INITIAL + 0.09]


def test_a_needless_repeat_does_not_keep_the_timer_from_learning() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.due(INITIAL)
    pilot.feedback(feedback(2), INITIAL + 0.005)
    assert pilot.timer.round_trip == INITIAL + 0.005
    pilot.intend(FAST, 1.0)
    pilot.due(1.0)
    assert pilot.due(1.0 + ECHO) == []


def test_a_feedback_that_was_issued_again_by_itself_is_no_sample() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.feedback(feedback(2, 2), 0.09)
    assert pilot.timer.round_trip is None


def test_pings_stand_in_until_commands_are_known() -> None:
    pilot = new_pilot()
    pilot.ping_answered(0.3)
    assert pilot.timer.round_trip == 0.3
    for event in range(2, 12):
        flying(pilot, event)
        pilot.feedback(feedback(event), event + 0.3)
    known = pilot.timer.round_trip
    pilot.ping_answered(9.0)
    assert pilot.timer.round_trip == known


def test_after_a_loss_commands_are_copied_until_their_answer_for_a_while() -> None:
    pilot = new_pilot()
    pilot.loss(0.0)
    command = flying(pilot)
    assert pilot.wake_at(0.0) == ECHO
    for copy in range(1, ECHOES + 1):
        assert pilot.due((copy + 0.01) * ECHO) == [command]
    assert pilot.wake_at(ECHOES * ECHO) == INITIAL
    assert (pilot.echoes, pilot.repeats) == (ECHOES, 0)
    pilot.feedback(feedback(2), 0.07)
    assert pilot.timer.round_trip == 0.07
    flying(pilot, LOSSY_SPELL)
    assert pilot.due(LOSSY_SPELL + ECHO) == []


def test_the_answer_ends_the_copies() -> None:
    pilot = new_pilot()
    pilot.loss(0.0)
    command = flying(pilot)
    assert pilot.due(1.01 * ECHO) == [command]
    pilot.feedback(feedback(2), 1.5 * ECHO)
    assert pilot.due(ECHOES * ECHO) == []
    assert pilot.echoes == 1


def test_on_a_lossy_path_each_repeat_is_a_salvo_that_ends_with_the_answer() -> None:
    pilot = new_pilot()
    pilot.loss(0.0)
    command = flying(pilot)
    pilot.due(4 * ECHO)
    assert pilot.due(INITIAL) == [command]
    assert pilot.wake_at(INITIAL) == INITIAL + SALVO_SPACING
    assert pilot.due(INITIAL + 2.5 * SALVO_SPACING) == [command] * 2
    assert pilot.due(INITIAL + 0.05) == [command] * (SALVO - 3)
    assert pilot.due(INITIAL + 0.09) == []
    assert pilot.due(2 * INITIAL) == [command]
    assert pilot.due(2 * INITIAL + 1.5 * SALVO_SPACING) == [command]
    pilot.feedback(feedback(2), 2 * INITIAL + 2 * SALVO_SPACING)
    assert command not in pilot.due(5.0)


def test_a_repeat_that_leaves_before_an_answer_can_have_come_is_single() -> None:
    pilot = new_pilot()
    pilot.ping_answered(0.6)
    pilot.loss(0.0)
    command = flying(pilot)
    pilot.due(4 * ECHO)
    assert pilot.due(0.5) == [command], "the interval is half a second at most"
    assert pilot.due(0.55) == []
    assert pilot.due(1.0) == [command], "no answer came in a round trip"
    assert pilot.due(1.0 + 1.5 * SALVO_SPACING) == [command]


def test_with_a_short_interval_there_is_no_salvo() -> None:
    pilot = new_pilot()
    for event in range(2, 20):
        flying(pilot, event)
        pilot.feedback(feedback(event), event + 0.005)
    assert pilot.timer.interval == FLOOR
    pilot.loss(20.0)
    command = flying(pilot, 20.0)
    assert pilot.due(20.0 + FLOOR) == [command]
    assert pilot.due(20.0 + FLOOR + 3 * SALVO_SPACING) == []


def test_a_repeat_that_was_needed_is_a_loss() -> None:
    pilot = new_pilot()
    flying(pilot)
    pilot.due(INITIAL)
    pilot.feedback(feedback(2), 2 * INITIAL)
    flying(pilot, 1.0)
    assert len(commands(pilot.due(1.0 + ECHO))) == 1
