from robot_bridge.link_guard import MAX_ADDRESSES, REFILL, TRIES, LinkGuard


def test_a_few_failures_are_free_then_an_address_has_to_wait() -> None:
    guard = LinkGuard()
    for _ in range(TRIES):
        assert not guard.is_blocked("a", 0.0)
        guard.failed("a", 0.0)
    assert guard.is_blocked("a", 0.0)
    assert not guard.is_blocked("b", 0.0)
    assert guard.is_blocked("a", REFILL * 0.9)
    assert not guard.is_blocked("a", REFILL)
    guard.failed("a", REFILL)
    assert guard.is_blocked("a", REFILL * 1.5)


def test_many_failures_do_not_add_up_to_a_longer_wait() -> None:
    guard = LinkGuard()
    for _ in range(1000):
        guard.failed("a", 0.0)
    assert not guard.is_blocked("a", REFILL)


def test_a_success_forgives() -> None:
    guard = LinkGuard()
    for _ in range(TRIES):
        guard.failed("a", 0.0)
    guard.succeeded("a")
    guard.succeeded("never seen")
    assert not guard.is_blocked("a", 0.0)


def test_the_addresses_that_are_remembered_are_bounded() -> None:
    guard = LinkGuard()
    for number in range(10 * MAX_ADDRESSES):
        for _ in range(TRIES):
            guard.failed(str(number), 0.0)
    assert not guard.is_blocked("0", 0.0)
    assert guard.is_blocked(str(10 * MAX_ADDRESSES - 1), 0.0)
    assert len(guard._spent) == MAX_ADDRESSES
