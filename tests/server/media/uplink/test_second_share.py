"""Whether a robot makes second encodings: the operator's bits come first, and a narrow uplink loses them first."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.media.uplink.second_share import KEEP, PATIENCE, WORTH, SecondShare

FIRST, MOST = 200_000.0, 800_000.0


def decide(share: SecondShare, now: float, *, rate: float = 2e6, limited: bool = False, most: float = MOST) -> float:
    share.came(now)
    return share.decide(now, first_bps=FIRST, most_bps=most, rate_bps=rate, limited=limited)


def begun(rate: float = 2e6) -> SecondShare:
    share = SecondShare()
    assert decide(share, 0.0, rate=rate) == 0
    assert decide(share, 4.9, rate=rate) == 0
    assert decide(share, 5.0, rate=rate) > 0
    return share


def test_it_begins_when_observers_were_due_more_for_five_seconds() -> None:
    assert begun().on


def test_it_begins_with_a_trial_where_the_operators_bits_never_showed_what_the_uplink_carries() -> None:
    assert decide(begun(), 5.1, rate=1.2 * FIRST) == WORTH * FIRST


def test_none_is_made_that_is_hardly_better_than_the_operators() -> None:
    share = SecondShare()
    assert [decide(share, float(now), most=1.4 * FIRST) for now in range(20)] == [0.0] * 20


def test_a_limit_leaves_it_what_the_operator_leaves_and_ends_it_when_that_is_too_little() -> None:
    share = begun()
    assert decide(share, 6.0, rate=500_000.0, limited=True) == 300_000.0
    assert decide(share, 6.1, rate=FIRST * (1 + KEEP) - 1, limited=True) == 0
    assert not share.on


def test_a_trial_that_failed_is_tried_again_later_each_time() -> None:
    share, now, starts = begun(), 5.0, list[float]()
    for _ in range(3):
        assert decide(share, now, rate=300_000.0, limited=True) == 0
        ended = now
        while not share.on:
            now += 0.1
            decide(share, now)
        starts.append(now - ended)
    assert [round(each / PATIENCE) for each in starts] == [1, 2, 4]


def test_it_ends_when_nobody_is_due_more_and_when_no_picture_comes() -> None:
    share = begun()
    assert decide(share, 6.0, most=0.0) == 0
    share = begun()
    for now in (6.0, 7.9):
        assert share.decide(now, first_bps=FIRST, most_bps=MOST, rate_bps=2e6, limited=False) > 0
    assert share.decide(8.1, first_bps=FIRST, most_bps=MOST, rate_bps=2e6, limited=False) == 0


looks = st.tuples(
    st.floats(0.05, 5.0), st.floats(3e4, 3e6), st.floats(0, 3e6), st.floats(3e4, 6e6), st.booleans(), st.booleans()
)


@given(st.lists(looks, max_size=200))
def test_it_never_takes_what_the_operator_has_nor_more_than_a_limited_uplink_carried(
    steps: list[tuple[float, float, float, float, bool, bool]],
) -> None:
    share, now = SecondShare(), 0.0
    for passed, first, most, rate, limited, came in steps:
        now += passed
        if came:
            share.came(now)
        was_on = share.on
        bps = share.decide(now, first_bps=first, most_bps=most, rate_bps=rate, limited=limited)
        assert 0 <= bps <= most
        assert (bps > 0) == share.on
        if limited:
            assert was_on or not share.on  # no trial on a path that is known to be narrow
            assert bps == 0 or first + bps <= rate + 1
        elif bps:
            assert first + bps <= max(rate, first * (1 + WORTH)) + 1
