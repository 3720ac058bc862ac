"""Whether the operator holds the key or the pedal, at the times at which a terminal or a device tells."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.lead.hold_to_run import REPEAT, HeldKey, HeldPedal

PRESSED, RELEASED, REPEATED = 1, 0, 2


def test_a_tap_does_not_drive() -> None:
    key = HeldKey()
    key.typed(1.0)
    assert not key.held(1.0)


def test_a_key_that_repeats_is_held_until_it_repeats_no_more() -> None:
    key = HeldKey()
    key.typed(1.0)
    for repeat in range(10):
        key.typed(1.5 + 0.09 * repeat)
        assert key.held(1.5 + 0.09 * repeat) == (repeat > 0)  # the first repeat comes after a pause
    assert key.held(1.5 + 0.09 * 9 + REPEAT - 0.001)
    assert not key.held(1.5 + 0.09 * 9 + REPEAT + 0.001)


def test_another_key_ends_it() -> None:
    key = HeldKey()
    key.typed(1.0)
    key.typed(1.1)
    key.other()
    assert not key.held(1.1)
    key.typed(1.15)
    assert not key.held(1.15)


@given(st.lists(st.floats(0, 1), max_size=30))
def test_it_is_never_held_longer_than_one_repeat_after_the_last_character(gaps: list[float]) -> None:
    key, now = HeldKey(), 0.0
    for gap in gaps:
        now += gap
        key.typed(now)
    assert not key.held(now + REPEAT + 1e-6)


def test_a_pedal_is_held_from_its_press_to_its_release() -> None:
    pedal = HeldPedal()
    pedal.event(30, PRESSED)
    assert pedal.held(0)
    pedal.event(30, RELEASED)
    assert not pedal.held(0)


def test_a_pedal_that_was_down_all_along_does_not_drive() -> None:
    pedal = HeldPedal()
    pedal.event(30, REPEATED)
    assert not pedal.held(0)


def test_a_pedal_that_is_unplugged_is_released() -> None:
    pedal = HeldPedal()
    pedal.event(30, PRESSED)
    pedal.gone()
    assert not pedal.held(0)


def test_a_pedal_whose_release_may_be_lost_counts_as_released() -> None:
    pedal = HeldPedal()
    pedal.event(30, PRESSED)
    pedal.lost()
    assert not pedal.held(0)
    pedal.event(30, REPEATED)
    assert not pedal.held(0), "it is down, and nobody has seen it up"
    pedal.event(30, RELEASED)
    pedal.event(30, PRESSED)
    assert pedal.held(0)
