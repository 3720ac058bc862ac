import pytest

from lockstep.bench.soak.memory import Sample, growth, growth_alike

FEW, MANY = (("H264", 2), ("VP8", 2)), (("H264", 4), ("VP8", 4))


def test_memory_that_stays_has_no_growth() -> None:
    assert growth([10.0, 50.0, *[100.0] * 20]) == 0


def test_what_is_taken_while_warming_up_does_not_count() -> None:
    assert growth([*range(25), *[100.0] * 75]) == 0


def test_a_leak_is_seen() -> None:
    found = growth([100.0 + second for second in range(100)])
    assert found is not None
    assert 0.3 < found < 0.6


def test_too_short_a_life_has_no_verdict() -> None:
    assert growth([1.0, 2.0]) is None


def test_encoders_that_open_and_close_are_no_growth() -> None:
    life = (
        [Sample(100.0, FEW)] * 60 + [Sample(140.0, MANY)] * 10 + [Sample(140.0, MANY)] * 50 + [Sample(100.0, FEW)] * 5
    )
    assert growth([sample.resident for sample in life]) == pytest.approx(0.4)
    assert growth_alike(life) == 0


def test_a_leak_is_seen_behind_them() -> None:
    life = [Sample((140.0 if second % 7 else 100.0) + second, MANY if second % 7 else FEW) for second in range(100)]
    found = growth_alike(life)
    assert found is not None
    assert 0.25 < found < 0.6


def test_moments_that_are_not_alike_are_not_compared() -> None:
    assert growth_alike([Sample(100.0, FEW)] * 50 + [Sample(140.0, MANY)] * 50) is None
