"""Whether a robot makes second encodings: the operator's bits come first, and a narrow uplink loses them first."""

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.media.uplink.second_share import (
    CUT,
    KEEP,
    MARGIN,
    MOST_PATIENCE,
    PATIENCE,
    QUEUE,
    START,
    SecondShare,
    UplinkNow,
)

FIRST, MOST = 200_000.0, 800_000.0
NEVER = float("-inf")
TICK = 0.1


def decide(
    share: SecondShare,
    now: float,
    *,
    shown: float = 0.0,
    carried: float = 0.0,
    waits: float | None = 0.0,
    limited_at: float = NEVER,
    first: float = FIRST,
    most: float = MOST,
) -> float:
    share.came(now)
    return share.decide(now, first_bps=first, most_bps=most, uplink=UplinkNow(shown, carried, waits, limited_at))


def begun(shown: float = 0.0) -> SecondShare:
    share = SecondShare()
    assert decide(share, 0.0, shown=shown) == 0
    assert decide(share, 4.9, shown=shown) == 0
    assert decide(share, 5.0, shown=shown) > 0
    return share


@dataclass
class Run:
    """An uplink of `capacity` bit/s, on which the bridge lets nothing of the second wait for more than 0.06 s."""

    share: SecondShare = field(default_factory=SecondShare)
    given: list[float] = field(default_factory=list)  # bits per second of the second, at each tick
    waits: list[float] = field(default_factory=list)  # s, of the operator's pictures

    def go(self, capacity: float, seconds: float, since: float = 0.0) -> float:
        queue, now = 0.0, since
        for _ in range(round(seconds / TICK)):
            now += TICK
            second = self.given[-1] if self.given else 0.0
            sent = second if queue / capacity < 0.06 else 0.0
            queue = max(0.0, queue + (FIRST + sent - capacity) * TICK)
            wait = queue / capacity
            carried = min(capacity, FIRST + sent) if queue else FIRST + sent
            self.given.append(decide(self.share, now, carried=carried, waits=wait))
            self.waits.append(wait)
        return now


def test_it_begins_when_observers_were_due_more_for_five_seconds() -> None:
    assert begun().on


def test_it_begins_with_a_little_where_nothing_is_known_and_with_what_the_uplink_has_shown() -> None:
    assert decide(begun(), 5.1) == pytest.approx(START * FIRST)
    assert decide(begun(900_000.0), 5.1) == pytest.approx(MARGIN * 900_000 - FIRST)


def test_it_does_not_begin_while_something_waits_or_nothing_is_known_or_the_uplink_has_shown_a_limit() -> None:
    share = SecondShare()
    for now in range(60):
        assert decide(share, float(now), waits=QUEUE) == 0
    for now in range(60, 120):
        assert decide(share, float(now), waits=None) == 0
    assert decide(share, 120.0, limited_at=115.1) == 0
    assert decide(share, 120.2, limited_at=115.1) > 0


def test_on_a_wide_uplink_observers_soon_get_all_that_they_are_due() -> None:
    run = Run()
    run.go(10_000_000.0, 15.0)
    assert run.given[-1] == MOST
    assert max(run.waits) == 0


def test_it_finds_what_the_operator_leaves_and_the_operators_pictures_hardly_wait() -> None:
    run = Run()
    run.go(700_000.0, 300.0)
    on = [each for each in run.given if each]
    assert len(on) > 0.9 * len(run.given)
    assert 300_000 < sum(on) / len(on) < 500_000
    assert max(run.waits) < 0.15
    assert sum(wait > 0.03 for wait in run.waits) < 0.02 * len(run.waits)


def test_an_uplink_without_room_is_tried_ever_more_seldom() -> None:
    run = Run()
    run.go(300_000.0, 3000.0)
    starts = [
        index * TICK
        for index, (before, now) in enumerate(zip(run.given, run.given[1:], strict=False))
        if now and not before
    ]
    gaps = [round(later - earlier) for earlier, later in zip(starts, starts[1:], strict=False)]
    assert gaps == sorted(gaps)
    assert gaps[0] >= PATIENCE
    assert gaps[-1] >= MOST_PATIENCE / 2
    assert sum(wait > 0.03 for wait in run.waits) < 0.01 * len(run.waits)


def test_a_limit_ends_it_at_once() -> None:
    share = begun()
    assert decide(share, 6.0, carried=5e5) > 0
    assert decide(share, 6.1, carried=5e5, limited_at=6.05) == 0


def test_one_that_went_well_is_tried_again_soon() -> None:
    share, now = begun(), 5.0
    for _ in range(5):
        while now < 1000.0 and share.on:
            now += 4.0
            decide(share, now, limited_at=now - 0.1 if now - share._began > 20 else NEVER)
        ended = now
        while not share.on:
            now += 1.0
            decide(share, now)
        assert now - ended <= PATIENCE + 1.0


def test_none_is_made_that_is_hardly_better_than_the_operators() -> None:
    share = SecondShare()
    assert [decide(share, float(now), most=1.4 * FIRST) for now in range(20)] == [0.0] * 20
    share = begun()
    assert decide(share, 6.0, first=FIRST * (1 + START) / (1 + KEEP) + 1000) == 0


def test_it_ends_when_nobody_is_due_more_and_when_no_picture_comes() -> None:
    share = begun()
    assert decide(share, 6.0, most=0.0) == 0
    share = begun()
    uplink = UplinkNow(0.0, 0.0, 0.0, NEVER)
    for now in (6.0, 7.9):
        assert share.decide(now, first_bps=FIRST, most_bps=MOST, uplink=uplink) > 0
    assert share.decide(8.1, first_bps=FIRST, most_bps=MOST, uplink=uplink) == 0


looks = st.tuples(
    st.floats(0.05, 5.0),
    st.floats(3e4, 3e6),
    st.floats(0, 3e6),
    st.builds(UplinkNow, st.floats(0, 6e6), st.floats(0, 6e6), st.none() | st.floats(0, 2.0), st.just(NEVER)),
    st.booleans(),
    st.booleans(),
)


@given(st.lists(looks, max_size=200))
def test_while_something_waits_both_encodings_get_less_than_what_arrives_and_never_more_than_before(
    steps: list[tuple[float, float, float, UplinkNow, bool, bool]],
) -> None:
    share, now, limited_at = SecondShare(), 0.0, NEVER
    total, held = 0.0, NEVER
    for passed, first, most, uplink, limited, came in steps:
        now += passed
        limited_at = now if limited else limited_at
        if came:
            share.came(now)
        was_on = share.on
        bps = share.decide(now, first_bps=first, most_bps=most, uplink=uplink._replace(limited_at=limited_at))
        assert 0 <= bps <= most
        assert (bps > 0) == share.on
        assert not (limited and share.on)
        waits = uplink.waits is None or uplink.waits >= QUEUE
        assert not (share.on and not was_on and waits), "it begins where nothing waits"
        if share.on and was_on and waits:
            assert first + bps <= max(total, first + most) + 1
            if uplink.waits is not None and uplink.waits > QUEUE and now >= held:
                assert first + bps <= CUT * uplink.carried_bps + 1
                held = now + 1.0 + uplink.waits
        if share.on and not was_on:
            held = NEVER
        total = first + bps
