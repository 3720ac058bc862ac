from random import Random

import pytest

from lockstep.emulator.impairment.delay import Lognormal, Uniform
from lockstep.emulator.impairment.impairment import Impairment, Wander
from lockstep.emulator.impairment.path import ImpairedPath

HONG_KONG = Lognormal(0.1475, 0.173, 0.523)


def test_a_wandering_delay_has_the_mean_and_the_bounds_of_its_distribution() -> None:
    wander = Wander(Random(1))
    delays = [wander.at(number * 0.01, HONG_KONG, 0.5) for number in range(400_000)]
    assert min(delays) >= 0.1475
    assert max(delays) <= 0.523
    assert sum(delays) / len(delays) == pytest.approx(0.173, rel=0.02)
    assert max(delays) > 0.35, "it does wander far"


def test_it_moves_evenly_so_that_packets_close_together_have_nearly_the_same_delay() -> None:
    wander = Wander(Random(1))
    delays = [wander.at(number * 0.001, Uniform(0, 0.1), 0.1) for number in range(10_000)]
    assert max(abs(one - other) for one, other in zip(delays, delays[1:], strict=False)) <= 0.001 + 1e-9


def test_a_dense_stream_keeps_the_mean_delay_though_the_order_is_kept() -> None:
    """Drawn for each packet, the slowest of each half second would hold up all others."""
    wandering = ImpairedPath(Impairment(delay=HONG_KONG, vary=0.5), "1")
    jumping = ImpairedPath(Impairment(delay=HONG_KONG), "1")
    for number in range(60_000):
        wandering.admit(number / 300, 1200)
        jumping.admit(number / 300, 1200)
    assert wandering.statistics.mean_delay == pytest.approx(0.173, rel=0.05)
    assert jumping.statistics.mean_delay > 0.25


def test_the_same_seed_wanders_the_same_way_whatever_the_packets_are() -> None:
    dense, sparse = Wander(Random(3)), Wander(Random(3))
    seen = {number: dense.at(number * 0.01, HONG_KONG, 0.5) for number in range(2000)}
    assert [sparse.at(number * 0.01, HONG_KONG, 0.5) for number in range(0, 2000, 90)] == [
        seen[number] for number in range(0, 2000, 90)
    ]


def test_a_changed_distribution_keeps_the_pattern() -> None:
    changed, same = Wander(Random(3)), Wander(Random(3))
    for number in range(50):
        changed.at(number * 0.1, Uniform(0, 1), 0.5)
        same.at(number * 0.1, Uniform(0, 1), 0.5)
    assert changed.at(5.2, Uniform(0, 2), 0.5) == pytest.approx(2 * same.at(5.2, Uniform(0, 1), 0.5))
