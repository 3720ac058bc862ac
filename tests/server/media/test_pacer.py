from hypothesis import given, settings
from hypothesis import strategies as st

from server.media.pacer import BURST_BYTES, FREE_BPS, HEADROOM, Pacer

PACKET = bytes(1200)


def seconds_for(pacer: Pacer, packets: int) -> float:
    """Until the last of them left, with a look every 4 ms."""
    waiting, now = [PACKET] * packets, 0.0
    while True:
        del waiting[: pacer.admit(waiting, now)]
        if not waiting:
            return now
        now += 0.004


def test_an_ordinary_picture_leaves_at_once() -> None:
    pacer = Pacer()
    pacer.limit(400_000)
    assert pacer.admit([PACKET] * 4, 0.0) == 4
    assert pacer.admit([PACKET] * 2, 0.033) == 2


def test_a_keyframe_is_spread_at_a_multiple_of_the_rate() -> None:
    pacer = Pacer()
    pacer.limit(400_000)
    spread = (50 * len(PACKET) - BURST_BYTES) * 8 / (400_000 * HEADROOM)
    assert 0.9 * spread < seconds_for(pacer, 50) < 1.1 * spread


def test_without_a_limit_a_keyframe_takes_milliseconds() -> None:
    assert 0 < seconds_for(Pacer(), 50) < 50 * len(PACKET) * 8 / FREE_BPS


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(0, 0.1), st.integers(1, 1500)), max_size=200), st.floats(50_000, 1e7))
def test_no_more_leaves_than_the_rate_and_one_burst(packets: list[tuple[float, int]], rate: float) -> None:
    pacer = Pacer()
    pacer.limit(rate)
    now, sent = 0.0, 0
    pacer.admit([], now)
    for passed, size in packets:
        now += passed
        sent += size * pacer.admit([bytes(size)], now)
    assert sent <= BURST_BYTES + now * rate * HEADROOM / 8 + 1500
