"""When the command in flight is repeated, and what is learnt from its answer."""

from lockstep.client.control.retransmission import ECHO, ECHOES, LOSSY_SPELL, SALVO, SALVO_SPACING
from lockstep.protocol.pacing.repeat_timer import FLOOR, INITIAL
from tests.client.control.senders import FAST, commands, flying, new_sender
from tests.makers import feedback


def test_a_repeat_gives_no_sample_of_the_round_trip() -> None:
    sender = new_sender()
    flying(sender)
    sender.due(INITIAL)
    sender.feedback(feedback(2), INITIAL + 0.09)
    assert sender.retransmission.timer.round_trip is None
    assert list(sender.retransmission.samples) == [INITIAL + 0.09]


def test_a_needless_repeat_does_not_keep_the_timer_from_learning() -> None:
    sender = new_sender()
    flying(sender)
    sender.due(INITIAL)
    sender.feedback(feedback(2), INITIAL + 0.005)
    assert sender.retransmission.timer.round_trip == INITIAL + 0.005
    sender.intend(FAST, 1.0)
    sender.due(1.0)
    assert sender.due(1.0 + ECHO) == []


def test_a_feedback_that_was_issued_again_by_itself_is_no_sample() -> None:
    sender = new_sender()
    flying(sender)
    sender.feedback(feedback(2, 2), 0.09)
    assert sender.retransmission.timer.round_trip is None


def test_pings_stand_in_until_commands_are_known() -> None:
    sender = new_sender()
    sender.retransmission.ping_answered(0.3)
    assert sender.retransmission.timer.round_trip == 0.3
    for event in range(2, 12):
        flying(sender, event)
        sender.feedback(feedback(event), event + 0.3)
    known = sender.retransmission.timer.round_trip
    sender.retransmission.ping_answered(9.0)
    assert sender.retransmission.timer.round_trip == known


def test_after_a_loss_commands_are_copied_until_their_answer_for_a_while() -> None:
    sender = new_sender()
    sender.retransmission.loss(0.0)
    command = flying(sender)
    assert sender.wake_at(0.0) == ECHO
    for copy in range(1, ECHOES + 1):
        assert sender.due((copy + 0.01) * ECHO) == [command]
    assert sender.wake_at(ECHOES * ECHO) == INITIAL
    assert (sender.retransmission.echoes, sender.retransmission.repeats) == (ECHOES, 0)
    sender.feedback(feedback(2), 0.07)
    assert sender.retransmission.timer.round_trip == 0.07
    flying(sender, LOSSY_SPELL)
    assert sender.due(LOSSY_SPELL + ECHO) == []


def test_the_answer_ends_the_copies() -> None:
    sender = new_sender()
    sender.retransmission.loss(0.0)
    command = flying(sender)
    assert sender.due(1.01 * ECHO) == [command]
    sender.feedback(feedback(2), 1.5 * ECHO)
    assert sender.due(ECHOES * ECHO) == []
    assert sender.retransmission.echoes == 1


def test_on_a_lossy_path_each_repeat_is_a_salvo_that_ends_with_the_answer() -> None:
    sender = new_sender()
    sender.retransmission.loss(0.0)
    command = flying(sender)
    sender.due(4 * ECHO)
    assert sender.due(INITIAL) == [command]
    assert sender.wake_at(INITIAL) == INITIAL + SALVO_SPACING
    assert sender.due(INITIAL + 2.5 * SALVO_SPACING) == [command] * 2
    assert sender.due(INITIAL + 0.05) == [command] * (SALVO - 3)
    assert sender.due(INITIAL + 0.09) == []
    assert sender.due(2 * INITIAL) == [command]
    assert sender.due(2 * INITIAL + 1.5 * SALVO_SPACING) == [command]
    sender.feedback(feedback(2), 2 * INITIAL + 2 * SALVO_SPACING)
    assert command not in sender.due(5.0)


def test_a_repeat_that_leaves_before_an_answer_can_have_come_is_single() -> None:
    sender = new_sender()
    sender.retransmission.ping_answered(0.6)
    sender.retransmission.loss(0.0)
    command = flying(sender)
    sender.due(4 * ECHO)
    assert sender.due(0.5) == [command], "the interval is half a second at most"
    assert sender.due(0.55) == []
    assert sender.due(1.0) == [command], "no answer came in a round trip"
    assert sender.due(1.0 + 1.5 * SALVO_SPACING) == [command]


def test_with_a_short_interval_there_is_no_salvo() -> None:
    sender = new_sender()
    for event in range(2, 20):
        flying(sender, event)
        sender.feedback(feedback(event), event + 0.005)
    assert sender.retransmission.timer.interval == FLOOR
    sender.retransmission.loss(20.0)
    command = flying(sender, 20.0)
    assert sender.due(20.0 + FLOOR) == [command]
    assert sender.due(20.0 + FLOOR + 3 * SALVO_SPACING) == []


def test_a_repeat_that_was_needed_is_a_loss() -> None:
    sender = new_sender()
    flying(sender)
    sender.due(INITIAL)
    sender.feedback(feedback(2), 2 * INITIAL)
    flying(sender, 1.0)
    assert len(commands(sender.due(1.0 + ECHO))) == 1
