import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.loss import independent
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.transport.stream_path import StreamPath

LOSSY = Impairment(delay=Constant(0.05), loss=independent(0.1))


def delays(path: StreamPath, count: int, size: int) -> list[float]:
    return [path.admit(float(number * 1000), size) - number * 1000 for number in range(count)]


@given(st.lists(st.tuples(st.floats(0, 0.3), st.integers(1, 100_000)), max_size=100))
def test_everything_arrives_in_order(messages: list[tuple[float, int]]) -> None:
    path, now, last = StreamPath(LOSSY, "1", back=0.05), 0.0, 0.0
    for pause, size in messages:
        now += pause
        arrives = path.admit(now, size)
        assert arrives >= max(last, now + 0.05)
        last = arrives


def test_a_lost_small_message_waits_for_the_timer_which_doubles() -> None:
    found = {round(each, 3) for each in delays(StreamPath(LOSSY, "1", back=0.05), 3000, 100)}
    assert {0.05, 0.25, 0.65} <= found, "not lost; lost; lost twice"
    assert min(found) == 0.05


def test_a_loss_inside_a_large_message_costs_one_round_trip() -> None:
    found = delays(StreamPath(LOSSY, "1", back=0.05), 1000, 10 * 1448)
    late = sum(each > 0.06 for each in found) / 1000
    assert late == pytest.approx(1 - 0.9**10, abs=0.05)
    assert sum(each == pytest.approx(0.15) for each in found) > 500


def test_without_loss_there_is_only_the_delay() -> None:
    assert set(delays(StreamPath(Impairment(delay=Constant(0.5)), "1"), 5, 100)) == {0.5}


def test_the_rate_is_kept_and_nothing_is_dropped() -> None:
    path = StreamPath(Impairment(), "1", bottleneck=Bottleneck(8000))
    assert [path.admit(0, 1000) for _ in range(3)] == [1, 2, 3]


def test_after_an_outage_the_first_retry_gets_through() -> None:
    outages = Outages()
    path = StreamPath(Impairment(delay=Constant(0.01)), "1", back=0.01, outages=outages)
    outages.demand(0, 10)
    assert path.admit(0, 100) == pytest.approx(12.61), "tries after 0.2, 0.6, 1.4, 3, 6.2 and 12.6 s"
    assert path.admit(9.9, 100) == pytest.approx(12.61), "in order"
    assert path.statistics.held == 2


def test_an_outage_that_holds_ends_with_its_end() -> None:
    outages = Outages()
    path = StreamPath(Impairment(delay=Constant(0.01)), "1", outages=outages)
    outages.demand(0, 10, hold=True)
    assert path.admit(5, 100) == pytest.approx(10.01)


def test_the_same_seed_makes_the_same_delays() -> None:
    assert delays(StreamPath(LOSSY, "7"), 100, 100) == delays(StreamPath(LOSSY, "7"), 100, 100)
