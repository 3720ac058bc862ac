"""Serial numbers that wrap."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.sctp.serial import MASK_16, MASK_32, unwrap


def test_a_number_beyond_the_wrap_is_the_next_one() -> None:
    assert unwrap(0, MASK_32) == MASK_32 + 1
    assert unwrap(3, MASK_16 - 1, MASK_16) == MASK_16 + 4


def test_a_number_before_the_wrap_is_an_older_one() -> None:
    assert unwrap(MASK_32, MASK_32 + 5) == MASK_32
    assert unwrap(MASK_16, 0, MASK_16) == -1


@given(st.integers(-(2**40), 2**40), st.integers(-(2**31), 2**31 - 1))
def test_what_is_less_than_half_the_range_away_is_found_again(near: int, distance: int) -> None:
    assert unwrap((near + distance) & MASK_32, near) == near + distance
