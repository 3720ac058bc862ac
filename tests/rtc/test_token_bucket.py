from lockstep.rtc.token_bucket import TokenBucket


def test_a_bucket_gives_a_burst_and_then_its_rate() -> None:
    bucket = TokenBucket(2.0, 3.0)
    assert [bucket.take(0.0) for _ in range(4)] == [True, True, True, False]
    assert [bucket.take(0.5) for _ in range(2)] == [True, False]
    assert [bucket.take(100.0) for _ in range(4)] == [True, True, True, False]
    assert not bucket.has(100.0)


def test_a_refusal_takes_nothing_and_the_wait_is_exact() -> None:
    bucket = TokenBucket(4.0, 1.0)
    assert bucket.take(10.0)
    assert [bucket.take(10.0) for _ in range(9)] == [False] * 9
    assert bucket.wait(10.0) == 0.25
    assert bucket.take(10.25)


def test_a_clock_that_goes_back_gives_nothing() -> None:
    bucket = TokenBucket(1.0, 1.0)
    assert bucket.take(10.0)
    assert not bucket.take(5.0)
    assert not bucket.take(10.9)
    assert bucket.take(11.0)


def test_a_bucket_is_full_at_first_and_again_after_its_time() -> None:
    bucket = TokenBucket(1.0, 2.0)
    assert bucket.is_full(0.0)
    assert bucket.take(0.0)
    assert not bucket.is_full(0.5)
    assert bucket.is_full(1.0)


def test_an_overdraft_passes_while_a_token_is_left_and_is_paid_back_first() -> None:
    bucket = TokenBucket(100.0, 10.0)
    assert bucket.overdraw(60.0, 0.0)
    assert bucket.level(0.0) == -50.0
    assert not bucket.overdraw(1.0, 0.5)
    assert bucket.wait(0.0, level=0.0) == 0.0
    assert bucket.overdraw(1.0, 0.51)


def test_a_bucket_fills_at_the_rate_that_holds() -> None:
    bucket = TokenBucket(1.0, 1.0)
    assert bucket.take(0.0)
    bucket.rate = 10.0
    assert bucket.wait(0.0) == 0.1
    assert bucket.take(0.1)
