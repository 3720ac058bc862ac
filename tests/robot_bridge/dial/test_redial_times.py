import random

from lockstep.robot_bridge.dial.redial_times import FIRST, LATE, REFUSED, SOON, SOON_TRIES, RedialTimes


def test_waits_grow_to_a_bound_and_differ_between_robots() -> None:
    times, others = RedialTimes(random.Random(1)), RedialTimes(random.Random(2))
    waits = [times.wait(refused=False) for _ in range(SOON_TRIES)]
    assert waits != [others.wait(refused=False) for _ in range(SOON_TRIES)]
    assert FIRST / 2 <= waits[0] <= FIRST
    assert max(waits) <= SOON


def test_a_console_that_is_away_for_long_is_asked_less_often_and_for_ever() -> None:
    times = RedialTimes(random.Random(1))
    waits = [times.wait(refused=False) for _ in range(SOON_TRIES + 5000)]
    assert min(waits[-4000:]) >= LATE / 2
    assert max(waits) <= LATE


def test_a_refusal_that_only_a_person_ends_waits_longer() -> None:
    assert RedialTimes(random.Random(1)).wait(refused=True) >= REFUSED / 2


def test_a_link_that_worked_is_followed_by_a_try_at_once() -> None:
    times = RedialTimes(random.Random(1))
    for _ in range(50):
        times.wait(refused=False)
    times.healthy()
    assert times.wait(refused=False) <= FIRST


def test_every_few_tries_one_has_time_for_a_long_path() -> None:
    times, found = RedialTimes(random.Random(1)), []
    for _ in range(4):
        found.append(times.patience())
        times.wait(refused=False)
    assert max(found) == 10.0
    assert min(found) == 5.0
