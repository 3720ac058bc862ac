"""Percentiles of values, and of values that were counted."""

from collections import Counter

import pytest

from lockstep.server.recording.reading.samples import MAX_VALUES, Samples, percentile_of


@pytest.mark.parametrize("count", [1, 2, 19, 20, 21, 100])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.95, 1.0])
def test_counted_values_have_the_percentiles_that_the_values_have(count: int, share: float) -> None:
    values = [float(number * 7 % 13) for number in range(count)]
    samples = Samples()
    for value in values:
        samples.add(value)
    assert percentile_of(Counter(values), share) == samples.percentile(share)


def test_nothing_has_no_percentile() -> None:
    assert Samples().percentile(0.5) is None
    assert percentile_of({}, 0.5) is None
    assert percentile_of({3.0: 0}, 0.5) is None


def test_so_many_values_are_thinned_out_and_keep_their_percentiles() -> None:
    samples = Samples()
    for number in range(2 * MAX_VALUES):
        samples.add(number % 1000)
    assert samples.percentile(0.5) == pytest.approx(500, abs=10)
