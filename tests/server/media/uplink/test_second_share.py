"""Whether a robot makes second encodings: the operator's bits come first, and a narrow uplink loses them first."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.media.uplink.second_share import KEEP, MARGIN, PATIENCE, WORTH, SecondShare

FIRST, MOST = 200_000.0, 800_000.0
ENOUGH = FIRST * (1 + WORTH) / MARGIN  # bit/s that the uplink has to have carried


def decide(share: SecondShare, now: float, *, shown: float = 2e6, limited: bool = False, most: float = MOST) -> float:
    share.came(now)
    return share.decide(now, first_bps=FIRST, most_bps=most, shown_bps=shown, limited=limited)


def begun(shown: float = 2e6) -> SecondShare:
    share = SecondShare()
    assert decide(share, 0.0, shown=shown) == 0
    assert decide(share, 4.9, shown=shown) == 0
    assert decide(share, 5.0, shown=shown) > 0
    return share


def test_it_begins_when_observers_were_due_more_for_five_seconds() -> None:
    assert begun().on


def test_it_never_begins_on_an_uplink_that_was_not_seen_to_carry_both() -> None:
    share = SecondShare()
    assert [decide(share, float(now), shown=ENOUGH - 1) for now in range(2000)] == [0.0] * 2000
    assert decide(share, 2000.0, shown=ENOUGH + 1) > 0


def test_it_gets_what_the_operator_leaves_of_what_the_uplink_carried_before_it_began() -> None:
    share = begun(shown=700_000.0)
    for shown in (700_000.0, 3e6, 0.0):  # its own pictures show nothing new
        assert decide(share, 6.0, shown=shown) == MARGIN * 700_000.0 - FIRST
    share.came(6.1)
    left = [
        share.decide(6.1, first_bps=first, most_bps=MOST, shown_bps=2e6, limited=False)
        for first in (FIRST * KEEP, 400_000.0)
    ]
    assert left == [MARGIN * 700_000.0 - FIRST * KEEP, 0.0]


def test_none_is_made_that_is_hardly_better_than_the_operators() -> None:
    share = SecondShare()
    assert [decide(share, float(now), most=1.4 * FIRST) for now in range(20)] == [0.0] * 20


def test_a_limit_ends_it_at_once_and_it_is_tried_again_later_each_time() -> None:
    share, now, starts = begun(), 5.0, list[float]()
    for _ in range(3):
        assert decide(share, now, limited=True) == 0
        ended = now
        while not share.on:
            now += 0.1
            decide(share, now)
        starts.append(now - ended)
    assert [round(each / PATIENCE) for each in starts] == [1, 2, 4]


def test_it_does_not_begin_while_the_uplink_counts_as_limited() -> None:
    share = SecondShare()
    assert [decide(share, float(now), limited=True) for now in range(60)] == [0.0] * 60


def test_it_ends_when_nobody_is_due_more_and_when_no_picture_comes() -> None:
    share = begun()
    assert decide(share, 6.0, most=0.0) == 0
    share = begun()
    for now in (6.0, 7.9):
        assert share.decide(now, first_bps=FIRST, most_bps=MOST, shown_bps=2e6, limited=False) > 0
    assert share.decide(8.1, first_bps=FIRST, most_bps=MOST, shown_bps=2e6, limited=False) == 0


looks = st.tuples(
    st.floats(0.05, 5.0), st.floats(3e4, 3e6), st.floats(0, 3e6), st.floats(3e4, 6e6), st.booleans(), st.booleans()
)


@given(st.lists(looks, max_size=200))
def test_both_encodings_never_take_more_than_the_uplink_was_known_to_carry(
    steps: list[tuple[float, float, float, float, bool, bool]],
) -> None:
    share, now, known = SecondShare(), 0.0, 0.0
    for passed, first, most, shown, limited, came in steps:
        now += passed
        if came:
            share.came(now)
        was_on = share.on
        bps = share.decide(now, first_bps=first, most_bps=most, shown_bps=shown, limited=limited)
        assert 0 <= bps <= most
        assert (bps > 0) == share.on
        assert not (limited and share.on)
        if share.on and not was_on:
            known = shown
        if share.on:
            assert first + bps <= known
