from hypothesis import given
from hypothesis import strategies as st

from lockstep.emulator.impairment.bottleneck import Bottleneck


def test_packets_leave_at_the_rate_and_what_does_not_fit_is_dropped() -> None:
    link = Bottleneck(rate=8000, queue=2500)  # 1000 bytes a second
    assert [link.admit(0, 1000), link.admit(0, 1000), link.admit(0, 1000)] == [1, 2, None]
    assert link.wait(0.5) == 1.5
    assert link.admit(0.5, 1000) == 3, "half of the first has left, so there is room for it"
    assert link.admit(10, 1000) == 11, "an idle link starts at once"
    assert (link.passed, link.dropped, link.longest_wait) == (4, 1, 1.5)


@given(st.lists(st.tuples(st.floats(0, 0.1), st.integers(40, 1500)), max_size=200))
def test_never_faster_than_the_rate_and_never_more_waiting_than_the_queue_holds(
    packets: list[tuple[float, int]],
) -> None:
    link, now, last, sent = Bottleneck(rate=512_000, queue=8000), 0.0, 0.0, 0
    for pause, size in packets:
        now += pause
        leaves = link.admit(now, size)
        if leaves is None:
            continue
        sent += size
        assert leaves >= last + size / 64_000 - 1e-9
        assert leaves - now <= 8000 / 64_000 + 1e-9
        last = leaves
    assert sent <= 64_000 * last + 1e-6
