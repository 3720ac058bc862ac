"""Whether a robot makes second encodings: the operator's bits come first, and a narrow uplink loses them first."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.link.sending.link_output import CLEAR
from lockstep.server.media.uplink.second_share import (
    CUT,
    KEEP,
    MARGIN,
    MOST_PATIENCE,
    PATIENCE,
    QUEUE,
    START,
    STEADY_SECONDS,
    SecondShare,
    UplinkNow,
)
from lockstep.server.media.uplink.uplink_estimator import UplinkEstimator

FIRST, MOST = 200_000.0, 800_000.0
NEVER = float("-inf")
PICTURE = 1 / 30  # s


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
    """A robot behind an uplink, the estimator and the share; the operator gets `first` bit/s as 30 pictures a second.

    The bridge sends no second picture while the round trip that its kernel has smoothed is 0.06 s longer than the
    shortest, as `LinkOutput.path_is_clear` has it; `gate` False: it does not know, as behind a proxy.
    """

    first: float = FIRST
    most: float = MOST
    gate: bool = True
    share: SecondShare = field(default_factory=SecondShare)
    uplink: UplinkEstimator = field(default_factory=lambda: UplinkEstimator(1e6, 1e5, 6e6))
    given: list[float] = field(default_factory=list)  # bits per second of the second, at each picture
    waits: list[float] = field(default_factory=list)  # s, of the operator's pictures, until they are through
    _under_way: deque[tuple[float, float, int, str | None]] = field(default_factory=deque)  # arrival, capture, bytes
    _queue: float = 0.0  # bits
    _round_trip: float = 0.0  # s, smoothed, beyond the shortest

    def go(self, capacity: Callable[[float], float], seconds: float) -> None:
        second = 0.0
        for number in range(1, round(seconds / PICTURE)):
            now, carries = number * PICTURE, capacity(number * PICTURE)
            self._queue = max(0.0, self._queue - carries * PICTURE)
            first = min(self.first, self.uplink.rate)
            self._send(now, first, carries, "main")
            self.waits.append(self._queue / carries)
            if second and not (self.gate and self._round_trip >= CLEAR):
                self._send(now, second, carries, None)
            self._arrive(now)
            if number % 3 == 0:
                second = self._decide(now, first)
            self.given.append(second)

    def _send(self, now: float, bps: float, carries: float, camera: str | None) -> None:
        bits = bps * PICTURE
        self._queue += bits
        self._under_way.append((now + self._queue / carries, now, round(bits / 8), camera))

    def _arrive(self, now: float) -> None:
        while self._under_way and self._under_way[0][0] <= now:
            arrival, captured, size, camera = self._under_way.popleft()
            self.uplink.arrived(captured, arrival, size, camera)
            self._round_trip += (arrival - captured - self._round_trip) / 8
            if camera is None:
                self.share.came(arrival)

    def _decide(self, now: float, first: float) -> float:
        self.uplink.decide(now)
        look = UplinkNow(
            self.uplink.shown(now), self.uplink.carried(), self.uplink.pictures_wait(now), self.uplink.limited_at
        )
        return self.share.decide(now, first_bps=first, most_bps=self.most, uplink=look)

    def wait(self, part: float) -> float:
        """Return a quantile of what the operator's pictures waited, s."""
        return sorted(self.waits)[int(part * len(self.waits))]

    @property
    def starts(self) -> list[float]:
        """The times at which a second encoding began, s."""
        pairs = enumerate(zip(self.given, self.given[1:], strict=False))
        return [index * PICTURE for index, (before, now) in pairs if now and not before]


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
    run.go(lambda now: 10_000_000.0, 15.0)
    assert run.given[-1] == MOST
    assert max(run.waits) < 0.01


@pytest.mark.parametrize("gate", [True, False])
@pytest.mark.parametrize("capacity", [1_100_000.0, 1_300_000.0, 1_500_000.0, 1_800_000.0, 2_200_000.0])
def test_a_second_encoding_that_wants_more_than_the_uplink_carries_hardly_delays_the_operators_pictures(
    capacity: float, gate: bool
) -> None:
    alone, run = Run(first=400_000.0, most=0.0), Run(first=400_000.0, most=2_000_000.0, gate=gate)
    for each in (alone, run):
        each.go(lambda now: capacity, 200.0)
    assert run.wait(0.5) < alone.wait(0.5) + 0.02
    assert run.wait(0.95) < alone.wait(0.95) + 0.05


def test_it_gets_most_of_what_the_operator_leaves() -> None:
    run = Run()
    run.go(lambda now: 700_000.0, 300.0)
    on = [each for each in run.given if each]
    assert len(on) > 0.9 * len(run.given)
    assert 300_000 < sum(on) / len(on) < 500_000


def test_an_uplink_without_room_is_tried_ever_more_seldom() -> None:
    run = Run()
    run.go(lambda now: 300_000.0, 1500.0)
    gaps = [round(later - earlier) for earlier, later in zip(run.starts, run.starts[1:], strict=False)]
    assert gaps == sorted(gaps)
    assert gaps[0] >= PATIENCE
    assert gaps[-1] >= MOST_PATIENCE / 2


@pytest.mark.parametrize("period", [8.0, 20.0, 40.0])
def test_an_uplink_that_is_wide_for_some_seconds_at_a_time_is_tried_ever_more_seldom(period: float) -> None:
    run = Run(first=400_000.0, most=2_000_000.0)
    run.go(lambda now: 1.1e6 + 0.7e6 * math.sin(2 * math.pi * now / period), 600.0)
    assert len(run.starts) <= 6


def test_a_limit_ends_it_at_once() -> None:
    share = begun()
    assert decide(share, 6.0, carried=5e5) > 0
    assert decide(share, 6.1, carried=5e5, limited_at=6.05) == 0


def test_one_that_went_well_is_tried_again_soon() -> None:
    share, now = begun(), 5.0
    for _ in range(5):
        while now < 1000.0 and share.on:
            now += 4.0
            decide(share, now, limited_at=now - 0.1 if now - share._began > 2 * STEADY_SECONDS else NEVER)
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


def test_a_queue_now_and_then_does_not_hold_it_down_for_ever() -> None:
    share, given = begun(), 0.0
    for step in range(36_000):  # an hour
        waits = 0.3 if step % 6000 < 3 else 0.0  # s; once in ten minutes
        given = decide(share, 5.0 + step / 10, carried=FIRST + given, waits=waits)
    assert given == MOST
