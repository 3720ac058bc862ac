import pytest

from lockstep.bench.figures.samples import median, quantile


def test_a_quantile_is_always_one_of_the_samples() -> None:
    assert quantile([4.0, 1.0, 3.0, 2.0], 0.5) == 2.0
    assert quantile([4.0, 1.0, 3.0, 2.0], 0.51) == 3.0
    assert quantile([1.0, 2.0], 1.0) == 2.0


def test_the_99th_percentile_of_a_hundred_leaves_one_sample_above() -> None:
    assert quantile([float(n) for n in range(1, 101)], 0.99) == 99.0
    assert quantile([float(n) for n in range(1, 101)], 0.07) == 7.0


def test_one_sample_is_every_quantile() -> None:
    assert median([5.0]) == quantile([5.0], 0.01) == quantile([5.0], 1.0) == 5.0


@pytest.mark.parametrize("share", [0.0, -0.1, 1.1])
def test_a_share_outside_of_0_to_1_is_refused(share: float) -> None:
    with pytest.raises(ValueError, match="share"):
        quantile([1.0], share)


def test_no_samples_have_no_median() -> None:
    with pytest.raises(ValueError, match="no samples"):
        median([])
