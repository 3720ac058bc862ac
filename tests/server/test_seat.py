from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.seat import TABLE, ControlSeat, SeatInput, SeatOutcome, Standing

TIMEOUT = 3.0


def _seat(standing: Standing) -> ControlSeat:
    """A seat as "me" sees it."""
    seat = ControlSeat(TIMEOUT)
    if standing is not Standing.FREE:
        seat.request("me" if standing is Standing.HOLDER else "other", "name", "operator", 0.0)
    return seat


def _apply(seat: ControlSeat, what: SeatInput) -> SeatOutcome:
    match what:
        case SeatInput.REQUEST:
            return seat.request("me", "name", "operator", 1.0)
        case SeatInput.RELEASE:
            return seat.release("me")
        case SeatInput.GONE:
            return seat.gone("me")
        case SeatInput.SILENT:
            seat.heard("other", 100.0)  # only my silence is meant
            return seat.expire(TIMEOUT + 1)


def test_the_table_is_complete() -> None:
    assert set(TABLE) == set(product(Standing, SeatInput))


@pytest.mark.parametrize(("standing", "what"), list(product(Standing, SeatInput)))
def test_every_cell_of_the_table(standing: Standing, what: SeatInput) -> None:
    seat = _seat(standing)
    assert seat.standing("me") is standing
    outcome = _apply(seat, what)
    assert outcome == TABLE[standing, what]
    if outcome.rest:
        assert (seat.seat.holder, seat.seat.why) == ("", what.value)
    elif outcome.changed:
        assert seat.holds("me")
    else:
        assert seat.standing("me") is standing


def test_an_observer_never_gets_the_seat() -> None:
    seat = ControlSeat(TIMEOUT)
    assert seat.request("me", "name", "observer", 0.0).refusal == "not_allowed"
    assert seat.standing("me") is Standing.FREE


def test_who_speaks_in_time_keeps_the_seat() -> None:
    seat = _seat(Standing.HOLDER)
    for now in range(1, 20):
        seat.heard("me", now * TIMEOUT * 0.9)
        assert seat.expire(now * TIMEOUT * 0.9 + TIMEOUT * 0.9) == SeatOutcome()
    assert seat.expire(19 * TIMEOUT * 0.9 + TIMEOUT).rest


def test_the_words_of_others_do_not_keep_the_seat() -> None:
    seat = _seat(Standing.HOLDER)
    seat.heard("other", TIMEOUT)
    assert seat.expire(TIMEOUT).rest


@given(st.lists(st.tuples(st.sampled_from(["a", "b", "c"]), st.sampled_from(SeatInput), st.floats(0, 2))))
def test_whenever_the_holder_changes_the_robot_rests_first(steps: list[tuple[str, SeatInput, float]]) -> None:
    seat, now = ControlSeat(TIMEOUT), 0.0
    for peer, what, wait in steps:
        now += wait
        before = seat.seat.holder
        match what:
            case SeatInput.REQUEST:
                outcome = seat.request(peer, peer, "operator", now)
            case SeatInput.RELEASE:
                outcome = seat.release(peer)
            case SeatInput.GONE:
                outcome = seat.gone(peer)
            case SeatInput.SILENT:
                outcome = seat.expire(now)
        after = seat.seat.holder
        assert outcome.rest == (before != "" and after == "")
        assert outcome.changed == (before != after)
        assert not (before and after and before != after)
