"""When a second connection is told to people."""

from lockstep.protocol.dial_in import OWN_LINK_ENDS
from lockstep.server.robot.second_connection import WAIT_ENDS, SecondConnection


def tries(second: SecondConnection, start: float, end: float, every: float = 2.5) -> int:
    """How often people are told."""
    return sum(second.is_news(start + every * n) for n in range(int((end - start) / every) + 1))


def test_a_robot_that_waits_is_told_once_however_often_it_dials() -> None:
    assert tries(SecondConnection(), 0.0, 3600.0) == 1


def test_a_robot_that_comes_back_while_its_last_link_ends_is_not_told() -> None:
    assert tries(SecondConnection(), 0.0, OWN_LINK_ENDS - 0.1, 0.5) == 0


def test_breaks_far_from_one_another_are_no_wait() -> None:
    assert tries(SecondConnection(), 0.0, 3600.0, WAIT_ENDS + 1.0) == 0


def test_a_later_wait_is_told_again() -> None:
    second = SecondConnection()
    assert [tries(second, start, start + 20.0) for start in (0.0, 100.0)] == [1, 1]
