from lockstep.server.talkback.playout import CUSHION, MOST_WAITING, Playout


def test_what_somebody_begins_to_say_has_a_cushion_before_it() -> None:
    playout = Playout()
    assert playout.admit(0.02, 10.0, 10.0) == CUSHION
    assert playout.admit(0.02, 10.02, 10.02) == 0
    assert playout.admit(0.02, 12.0, 12.0) == CUSHION  # after a pause


def test_what_came_long_ago_is_left_out() -> None:
    playout = Playout()
    assert playout.admit(0.02, 10.0, 10.0 + MOST_WAITING + 0.01) is None
    assert playout.dropped == 1


def test_no_more_than_a_fifth_of_a_second_ever_waits() -> None:
    playout = Playout()
    admitted = [playout.admit(0.02, 10.0, 10.0) for _ in range(100)]
    played = [each for each in admitted if each is not None]
    assert 0.02 * len(played) + CUSHION <= MOST_WAITING + 1e-9
    assert playout.dropped == 100 - len(played)
    assert playout.admit(0.02, 10.02, 10.03) is not None  # as soon as there is room
