"""The lock-out topic without a ROS: silence locks as well as the word does."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.sensors import LockoutTopic
from lockstep.robot_bridge.robots.ros2.settings import Lockout

TOPIC = "/key_switch"


class OneTopic:
    """Stands for the side of ROS: keeps what would be called with a message."""

    def interface(self, name: str) -> str:
        return name

    def subscribe(self, message: str, topic: str, take: Callable[[Any], None]) -> None:
        assert (message, topic) == ("std_msgs/msg/Bool", TOPIC)
        self.take = take

    def says(self, *, locked: bool) -> None:
        self.take(SimpleNamespace(data=locked))


def lockout(*, hardware_stop: bool = False) -> tuple[OneTopic, LockoutTopic]:
    ros = OneTopic()
    return ros, LockoutTopic(cast(RosSide, ros), Lockout(topic=TOPIC, hardware_stop=hardware_stop, timeout=1.0))


def test_before_the_first_word_of_the_lockout_topic_the_robot_is_locked() -> None:
    _, topic = lockout()
    assert TOPIC in topic.reason(clock.now())


def test_the_lockout_topic_locks_and_lets_in_by_its_newest_word() -> None:
    ros, topic = lockout()
    ros.says(locked=True)
    assert topic.reason(clock.now()) == f"locked at the robot ({TOPIC})"
    ros.says(locked=False)
    topic.wait()
    assert topic.reason(clock.now()) == ""


def test_a_lockout_topic_that_falls_silent_locks() -> None:
    ros, topic = lockout()
    ros.says(locked=False)
    assert topic.reason(clock.now()) == ""
    assert topic.reason(clock.now() + 1.1) == f"no message of the lock-out topic arrives ({TOPIC})"


def test_a_lockout_that_is_a_hardware_stop_says_whether_it_is_pressed_while_it_is_heard() -> None:
    ros, topic = lockout(hardware_stop=True)
    assert topic.pressed(clock.now()) is None
    ros.says(locked=True)
    assert topic.pressed(clock.now()) is True
    assert topic.reason(clock.now()) == f"by {TOPIC}", "the robot is locked, and one cause is told once"
    ros.says(locked=False)
    assert topic.pressed(clock.now()) is False
    assert topic.pressed(clock.now() + 1.1) is None
    assert topic.reason(clock.now() + 1.1) != "", "silence locks all the same"
    ros, topic = lockout()
    ros.says(locked=True)
    assert topic.pressed(clock.now()) is None, "a key switch is no hardware stop"
