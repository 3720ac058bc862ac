from itertools import groupby
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.emulator.impairment.loss import NO_LOSS, Loss, LossState, bursty, independent

COUNT = 100_000


def pattern(loss: Loss, seed: int = 1, apart: float = 0.01) -> list[bool]:
    """Packets `apart` seconds."""
    random, state = Random(seed), LossState()
    return [state.loses(loss, random.random(), random.random(), apart * number) for number in range(COUNT)]


def mean_burst(lost: list[bool]) -> float:
    lengths = [len(list(group)) for each, group in groupby(lost) if each]
    return sum(lengths) / len(lengths)


def test_independent_loss_has_its_share_and_bursts_only_by_chance() -> None:
    lost = pattern(independent(0.05))
    assert sum(lost) / COUNT == pytest.approx(0.05, rel=0.05)
    assert mean_burst(lost) == pytest.approx(1 / 0.95, rel=0.05)


@pytest.mark.parametrize(("share", "length"), [(0.05, 4), (0.02, 3), (0.2, 10), (0.5, 2)])
def test_bursty_loss_has_its_share_and_its_length(share: float, length: float) -> None:
    lost = pattern(bursty(share, length))
    assert sum(lost) / COUNT == pytest.approx(share, rel=0.1)
    assert mean_burst(lost) == pytest.approx(length, rel=0.1)


def test_a_burst_is_over_after_a_pause_so_that_of_seldom_packets_each_is_lost_for_itself() -> None:
    lost = pattern(bursty(0.05, 10), apart=2.0)
    assert sum(lost) / COUNT == pytest.approx(0.05, rel=0.05)
    assert mean_burst(lost) == pytest.approx(1 / 0.95, rel=0.05)


def test_both_states_may_lose_their_own_share() -> None:
    loss = bursty(0.1, 20, good=0.02, bad=0.6)
    assert loss.mean == pytest.approx(0.1)
    assert sum(pattern(loss)) / COUNT == pytest.approx(0.1, rel=0.1)


def test_no_loss_loses_nothing() -> None:
    assert not any(pattern(NO_LOSS))


@given(st.floats(0, 0.49), st.floats(1, 100))
def test_the_probabilities_are_probabilities_and_make_the_share(share: float, length: float) -> None:
    loss = bursty(share, length)
    assert 0 <= loss.to_bad <= 1
    assert 0 < loss.to_good <= 1
    assert loss.mean == pytest.approx(share)


@pytest.mark.parametrize(
    ("share", "length", "good", "bad"), [(0.05, 0.5, 0, 1), (0.9, 1, 0, 1), (0.05, 4, 0.1, 1), (0.5, 4, 0, 0.5)]
)
def test_a_path_that_cannot_exist_is_refused(share: float, length: float, good: float, bad: float) -> None:
    with pytest.raises(ValueError, match="burst|loss"):
        bursty(share, length, good=good, bad=bad)
