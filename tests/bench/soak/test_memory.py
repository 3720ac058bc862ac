from bench.soak.memory import growth


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
