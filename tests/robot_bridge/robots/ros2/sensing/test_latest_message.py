"""The newest message of a topic."""

from lockstep.robot_bridge.robots.ros2.sensing.latest_message import BAD_SHOWN, Newest


def test_before_the_first_message_nothing_is_known_and_that_is_a_fault() -> None:
    newest: Newest[int] = Newest("/odom", 0.5)
    assert newest.fresh(10.0) is None
    assert newest.faults(10.0) == ["/odom: no message has arrived yet"]


def test_a_message_is_fresh_until_the_timeout_and_then_a_fault() -> None:
    newest: Newest[int] = Newest("/odom", 0.5)
    newest.put(7, 10.0)
    arrived = newest.fresh(10.5)
    assert arrived is not None
    assert arrived.value == 7
    assert newest.faults(10.5) == []
    assert newest.fresh(10.6) is None
    assert newest.faults(10.6) == ["/odom: no message for 0.6 s"]


def test_a_repeated_header_stamp_brings_nothing_new() -> None:
    newest: Newest[int] = Newest("/odom", 0.5)
    assert newest.put(1, 10.0, header=5)
    assert not newest.put(2, 10.4, header=5)
    assert newest.fresh(10.6) is None
    assert newest.put(3, 10.7, header=6)


def test_without_header_stamps_every_message_is_new() -> None:
    newest: Newest[int] = Newest("/cmd", 0.5)
    assert newest.put(1, 10.0)
    assert newest.put(1, 10.4)


def test_bad_messages_are_counted_by_name_and_shown_for_a_while() -> None:
    newest: Newest[int] = Newest("/image", 0.5)
    newest.put(1, 10.0)
    for _ in range(3):
        newest.refuse("upside down", 10.1)
    assert newest.bad["upside down"] == 3
    assert newest.faults(10.2) == ["/image: 3 × upside down"]
    newest.put(2, 10.1 + BAD_SHOWN)
    assert newest.faults(10.2 + BAD_SHOWN) == []
