import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.delay import Constant, Uniform
from lockstep.emulator.impairment.impairment import PERFECT, Impairment, Reordering
from lockstep.emulator.impairment.loss import bursty, independent
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.path import ImpairedPath, PathStatistics

LOSSY = Impairment(delay=Uniform(0.05, 0.15), loss=bursty(0.1, 3), vary=0.2)
Packets = list[tuple[float, int]]
packets = st.lists(st.tuples(st.floats(0, 0.3), st.integers(20, 1500)), max_size=100)


def arrivals(path: ImpairedPath, sent: Packets) -> list[float | None]:
    now, found = 0.0, []
    for pause, size in sent:
        now += pause
        found.append(path.admit(now, size))
    return found


def steady(path: ImpairedPath, count: int, pause: float = 0.01) -> list[float | None]:
    return arrivals(path, [(pause, 100)] * count)


@given(packets, st.integers())
def test_the_same_seed_and_packets_meet_the_same_fate(sent: Packets, seed: int) -> None:
    def path() -> ImpairedPath:
        return ImpairedPath(LOSSY, str(seed), Bottleneck(100_000, 5000))

    assert arrivals(path(), sent) == arrivals(path(), sent)


def test_another_seed_meets_another() -> None:
    assert steady(ImpairedPath(LOSSY, "1"), 200) != steady(ImpairedPath(LOSSY, "2"), 200)


@given(packets)
def test_packets_keep_their_order_and_none_is_faster_than_the_path(sent: Packets) -> None:
    path = ImpairedPath(Impairment(delay=Uniform(0.05, 0.5)), "1", Bottleneck(1_000_000, 20_000))
    now, last = 0.0, 0.0
    for pause, size in sent:
        now += pause
        arrives = path.admit(now, size)
        if arrives is not None:
            assert arrives >= max(last, now + 0.05)
            last = arrives


def test_how_densely_packets_come_does_not_change_which_are_lost() -> None:
    dense, sparse = steady(ImpairedPath(LOSSY, "1"), 500, 0.001), steady(ImpairedPath(LOSSY, "1"), 500, 0.4)
    assert [each is None for each in dense] == [each is None for each in sparse]


def test_what_is_changed_on_the_way_does_not_change_the_pattern_after_it() -> None:
    changed, same = ImpairedPath(PERFECT, "1"), ImpairedPath(Impairment(loss=independent(0.5)), "1")
    steady(changed, 100)
    changed.impairment = Impairment(loss=independent(0.5))
    pattern = steady(same, 200)
    assert [each is None for each in steady(changed, 100)] == [each is None for each in pattern[100:]]


def test_a_perfect_path_does_nothing() -> None:
    assert arrivals(ImpairedPath(PERFECT, "1"), [(0.5, 100), (0.5, 100)]) == [0.5, 1.0]


def test_reordered_packets_come_late_and_are_overtaken() -> None:
    path = ImpairedPath(Impairment(delay=Constant(0.05), reorder=Reordering(0.1, 0.03)), "1")
    found = [each for each in steady(path, 1000) if each is not None]
    overtaken = sum(one > other for one, other in zip(found, found[1:], strict=False))
    assert 60 < path.statistics.reordered < 140
    assert overtaken == pytest.approx(path.statistics.reordered, abs=30)


def test_an_outage_loses_what_comes_meanwhile_and_the_pattern_of_loss_goes_on() -> None:
    outages = Outages()
    path, free = ImpairedPath(LOSSY, "1", outages=outages), ImpairedPath(LOSSY, "1")
    outages.demand(0.5, 0.3)
    found, pattern = steady(path, 100), steady(free, 100)
    assert path.statistics.outage_dropped == 30
    assert [each is None for each in found[:49]] == [each is None for each in pattern[:49]]
    assert [each is None for each in found[80:]] == [each is None for each in pattern[80:]]


def test_an_outage_that_holds_delivers_everything_at_its_end_in_order() -> None:
    outages = Outages()
    path = ImpairedPath(Impairment(delay=Constant(0.01)), "1", outages=outages)
    outages.demand(1.0, 2.0, hold=True)
    found = [path.admit(now, 100) for now in (0.5, 1.5, 2.0, 2.995, 3.5)]
    assert found == pytest.approx([0.51, 3.0, 3.0, 3.005, 3.51])
    assert path.statistics.held == 3


def test_a_shared_bottleneck_lets_one_path_wait_for_the_other() -> None:
    link = Bottleneck(8000, 10_000)
    media, control = ImpairedPath(PERFECT, "1", link), ImpairedPath(PERFECT, "2", link)
    assert media.admit(0, 1000) == 1
    assert control.admit(0, 100) == pytest.approx(1.1)


def test_every_packet_is_counted_once_and_statistics_add_up() -> None:
    outages = Outages()
    outages.demand(0.2, 0.1)
    path = ImpairedPath(LOSSY, "1", Bottleneck(50_000, 2000), outages)
    steady(path, 300)
    counts = path.statistics
    assert counts.offered == 300
    assert counts.passed + counts.lost + counts.queue_dropped + counts.outage_dropped == 300
    assert min(counts.lost, counts.queue_dropped, counts.outage_dropped, counts.passed) > 0
    assert counts.bytes == 100 * counts.passed
    assert counts.mean_delay <= counts.max_delay
    total = PathStatistics()
    assert total.mean_delay == 0
    total.add(counts)
    total.add(counts)
    assert (total.offered, total.mean_delay, total.max_delay) == (600, counts.mean_delay, counts.max_delay)
