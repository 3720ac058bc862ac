import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.emulator.impairment.delay import Constant, Delay, Lognormal, Normal, Pareto, Uniform

SHARES = [(number + 0.5) / 20_000 for number in range(20_000)]
THESIS = [(10, 68, 772), (0, 0.3, 10), (0, 51, 672), (0, 0.1, 1), (10, 58, 821), (275, 278, 313), (295, 346, 1046)]


def mean_of(delay: Delay) -> float:
    return sum(map(delay.quantile, SHARES)) / len(SHARES)


@pytest.mark.parametrize(("least", "mean", "most"), THESIS)
def test_a_pings_three_figures_come_back_out_of_the_distribution(least: float, mean: float, most: float) -> None:
    delay = Lognormal(least, mean, most)
    assert least <= delay.quantile(0) <= delay.quantile(1) <= most
    assert mean_of(delay) - least == pytest.approx(mean - least, rel=0.01)
    assert delay.quantile(0.999) - least > 0.5 * (most - least), "the largest delays do happen"
    assert delay.quantile(0.5) < mean, "most packets are quicker than the mean"


@pytest.mark.parametrize(
    ("delay", "least", "mean", "most"),
    [
        (Constant(0.3), 0.3, 0.3, 0.3),
        (Uniform(0.1, 0.3), 0.1, 0.2, 0.3),
        (Normal(0.1, 0.02), 0.0, 0.1, 0.2),
        (Normal(0.1, 0.5, 0.05), 0.05, 0.1, 0.15),
        (Pareto(0.02, 0.05, 2.0), 0.02, 0.05, 2.0),
        (Pareto(0.02, 0.3, 2.0), 0.02, 0.3, 2.0),
    ],
)
def test_each_distribution_keeps_its_bounds_and_mean(delay: Delay, least: float, mean: float, most: float) -> None:
    assert least <= delay.quantile(0) <= delay.quantile(1) <= most
    assert delay.mean == pytest.approx(mean)
    assert delay.max == pytest.approx(most)
    assert mean_of(delay) == pytest.approx(mean, rel=0.01)


@given(st.floats(0, 1), st.floats(0.01, 0.9), st.floats(0.001, 5), st.floats(0, 1), st.floats(0, 1))
def test_any_three_figures_can_be_fitted_and_more_share_is_more_delay(
    least: float, part: float, width: float, one: float, other: float
) -> None:
    delay = Lognormal(least, least + part * width, least + width)
    low, high = sorted((delay.quantile(one), delay.quantile(other)))
    assert least <= low <= high <= least + width
    assert (delay.quantile(min(one, other)), delay.quantile(max(one, other))) == (low, high)


@pytest.mark.parametrize(("least", "mean", "most"), [(2, 1, 3), (1, 1, 3), (1, 3, 3), (-1, 1, 3)])
def test_figures_out_of_order_are_refused(least: float, mean: float, most: float) -> None:
    with pytest.raises(ValueError, match="min < mean < max"):
        Lognormal(least, mean, most)
    with pytest.raises(ValueError, match="min < mean < max"):
        Pareto(least, mean, most)


def test_what_a_shape_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="has a mean below"):
        Pareto(0.001, 0.9, 1)
    with pytest.raises(ValueError, match="normal needs"):
        Normal(0.1, 0.02, 0.2)
