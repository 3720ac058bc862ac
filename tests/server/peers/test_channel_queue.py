from lockstep.server.peers.channel_queue import ChannelQueue


def test_texts_leave_in_order_and_before_feedback() -> None:
    outbox = ChannelQueue()
    outbox.put_newest("feedback")
    outbox.put("first")
    outbox.put("second")
    assert [outbox.take() for _ in range(4)] == ["first", "second", "feedback", None]


def test_only_the_newest_feedback_waits() -> None:
    outbox = ChannelQueue()
    for number in range(5):
        outbox.put_newest(str(number))
    assert (outbox.take(), outbox.take()) == ("4", None)
    assert outbox.superseded == 4


def test_when_it_is_full_the_oldest_goes_and_is_counted() -> None:
    outbox = ChannelQueue(max_waiting=2)
    for text in "abc":
        outbox.put(text)
    assert [outbox.take() for _ in range(3)] == ["b", "c", None]
    assert outbox.dropped == 1
