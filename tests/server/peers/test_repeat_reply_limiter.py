"""Which repeats of an executed command are answered."""

from lockstep.server.peers.repeat_reply_limiter import SPACING, RepeatReplyLimiter


def test_over_a_path_that_merely_loses_packets_every_repeat_is_answered() -> None:
    pace = RepeatReplyLimiter()
    assert all(pace.allows(1.0 + 0.003 * repeat, queues=False) for repeat in range(16))


def test_over_a_path_that_queues_one_at_a_time_is_answered() -> None:
    pace = RepeatReplyLimiter()
    answered = [pace.allows(0.02 * repeat, queues=True) for repeat in range(101)]
    assert answered[0]
    assert sum(answered) == 1 + int(2.0 / (0.02 * -(-SPACING // 0.02)))


def test_what_went_before_the_path_queued_counts() -> None:
    pace = RepeatReplyLimiter()
    assert pace.allows(1.0, queues=False)
    assert not pace.allows(1.1, queues=True)
    assert pace.allows(1.0 + SPACING, queues=True)
