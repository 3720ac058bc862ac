from lockstep.server.peers.channel_queue import ChannelQueue


def test_texts_leave_in_order_and_before_feedback() -> None:
    queue = ChannelQueue()
    queue.put_newest("feedback")
    queue.put("first")
    queue.put("second")
    assert [queue.take() for _ in range(4)] == ["first", "second", "feedback", None]


def test_only_the_newest_feedback_waits() -> None:
    queue = ChannelQueue()
    for number in range(5):
        queue.put_newest(str(number))
    assert (queue.take(), queue.take()) == ("4", None)
    assert queue.superseded == 4


def test_when_it_is_full_the_oldest_goes_and_is_counted() -> None:
    queue = ChannelQueue(max_waiting=2)
    for text in "abc":
        queue.put(text)
    assert [queue.take() for _ in range(3)] == ["b", "c", None]
    assert queue.dropped == 1
