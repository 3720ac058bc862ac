"""What the messages of a topic say, and how often they come."""

from types import SimpleNamespace
from typing import Any

import pytest

from lockstep.robot_bridge.robots.ros2.discovery.graph import Heard
from lockstep.robot_bridge.robots.ros2.discovery.topic_messages import TopicMessages


def message(**fields: Any) -> Any:
    return SimpleNamespace(header=SimpleNamespace(frame_id="frame"), **fields)


def test_the_rate_is_that_of_the_gaps() -> None:
    messages = TopicMessages()
    assert messages.heard() == Heard()
    messages.take(message(), 10.0, 0.0)
    assert messages.heard().rate is None
    for number in range(1, 5):
        messages.take(message(), 10.0 + number / 20, 0.0)
    assert messages.heard().rate == pytest.approx(20.0)
    assert messages.heard().count == 5


def test_one_stamp_of_another_clock_suffices_to_distrust_all() -> None:
    for age in (-0.1, 100.0, None):
        messages = TopicMessages()
        messages.take(message(), 1.0, 0.01)
        assert messages.heard().stamped
        messages.take(message(), 2.0, age)
        messages.take(message(), 3.0, 0.01)
        assert not messages.heard().stamped


def test_joints_of_several_messages_are_put_together_up_to_a_bound() -> None:
    messages = TopicMessages()
    messages.take(message(name=["a", "b"], position=[0.0, 0.0]), 1.0, 0.0)
    messages.take(message(name=["c", "", "x" * 1000], position=[0.0] * 3), 2.0, 0.0)
    assert messages.heard().joints == ("a", "b", "c")
    for number in range(100):
        messages.take(message(name=[f"j{number}"], position=[0.0]), 3.0, 0.0)
    assert len(messages.heard().joints) == 64
