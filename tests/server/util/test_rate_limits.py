from lockstep.server.util.rate_limits import RateLimits


def test_a_burst_is_allowed_and_then_only_the_rate() -> None:
    limits = RateLimits(rate=2, burst=3)
    assert [limits.spend("a", 0.0) for _ in range(4)] == [True, True, True, False]
    assert limits.spend("a", 0.5)
    assert not limits.spend("a", 0.5)


def test_keys_do_not_share() -> None:
    limits = RateLimits(rate=1, burst=1)
    assert limits.spend("a", 0.0)
    assert limits.spend("b", 0.0)
    assert not limits.spend("a", 0.0)


def test_refusals_cost_nothing_and_the_level_never_passes_the_burst() -> None:
    limits = RateLimits(rate=1, burst=2)
    assert [limits.spend("a", 0.0) for _ in range(9)].count(True) == 2
    assert [limits.spend("a", 1000.0) for _ in range(9)].count(True) == 2


def test_a_clock_that_stands_still_or_goes_back_gives_nothing() -> None:
    limits = RateLimits(rate=1, burst=1)
    assert limits.spend("a", 10.0)
    assert not limits.spend("a", 5.0)


def test_only_so_many_keys_are_remembered_the_latest() -> None:
    limits = RateLimits(rate=0.001, burst=1, max_keys=3)
    for key in "abcd":
        assert limits.spend(key, 0.0)
    assert len(limits) == 3
    assert limits.spend("a", 0.0), "forgotten"
    assert not limits.spend("d", 0.0)
