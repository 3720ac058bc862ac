from itertools import pairwise

from lockstep.server.util.backoff import Backoff


def test_the_wait_doubles_up_to_the_cap_with_jitter() -> None:
    backoff = Backoff(0.1, 2.0)
    waits = [backoff.next() for _ in range(50)]
    for number, wait in enumerate(waits):
        full = min(2.0, 0.1 * 2**number)
        assert full / 2 <= wait <= full
    assert any(a != b for a, b in pairwise(waits[10:]))


def test_after_a_healthy_spell_it_begins_anew() -> None:
    backoff = Backoff(0.1, 2.0)
    for _ in range(10):
        backoff.next()
    backoff.healthy()
    assert backoff.next() <= 0.1
