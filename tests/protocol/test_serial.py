import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.serial import FIRST_EVENT, MAX_EVENT, event_after, event_gap, is_event, is_newer

events = st.integers(FIRST_EVENT, MAX_EVENT)


@pytest.mark.parametrize(("value", "expected"), [(0, False), (1, True), (MAX_EVENT, True), (2**31, False), (-1, False)])
def test_a_reference_is_1_to_the_largest_31_bit_number(value: int, expected: bool) -> None:
    assert is_event(value) is expected


def test_the_successor_of_the_largest_is_1_because_0_means_unset() -> None:
    assert event_after(1) == 2
    assert event_after(MAX_EVENT) == 1


@pytest.mark.parametrize(
    ("newer", "older", "gap"),
    [
        (5, 5, 0),
        (6, 5, 1),
        (5, 6, -1),
        (1, MAX_EVENT, 2),
        (MAX_EVENT, 1, -2),
        (2**30, 1, 2**30 - 1),
        (2**30 + 1, 1, -(2**30)),
        (1, 2**30 + 1, -(2**30)),
    ],
)
def test_the_gap_follows_serial_arithmetic(newer: int, older: int, gap: int) -> None:
    assert event_gap(newer, older) == gap


@given(events)
def test_the_successor_is_valid_newer_and_at_most_2_ahead(event: int) -> None:
    after = event_after(event)
    assert is_event(after)
    assert is_newer(after, event)
    assert event_gap(after, event) == (2 if event == MAX_EVENT else 1)


@given(events, events)
def test_of_two_references_at_most_one_is_newer(a: int, b: int) -> None:
    assert not (is_newer(a, b) and is_newer(b, a))
    if event_gap(a, b) != -(2**30):
        assert event_gap(a, b) == -event_gap(b, a)
