"""What MoveIt Servo says of itself becomes a fault in words. Its own message package is not among the wheels."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.servo_status import ServoStatusTopic
from lockstep.robot_bridge.robots.ros2.settings import ServoStatus

TOPIC = "/servo_node/status"


class OneTopic:
    """Stands for the side of ROS: keeps what would be called with a message."""

    def interface(self, name: str) -> str:
        return name

    def subscribe(self, message: str, topic: str, take: Callable[[Any], None]) -> None:
        self.message_name = message
        self.take = take


def status(settings: ServoStatus) -> tuple[OneTopic, ServoStatusTopic]:
    ros = OneTopic()
    return ros, ServoStatusTopic(cast(RosSide, ros), settings)


def test_a_warning_is_shown_in_servos_own_words_until_all_is_well() -> None:
    ros, topic = status(ServoStatus())
    assert ros.message_name == "moveit_msgs/msg/ServoStatus"
    ros.take(SimpleNamespace(code=2, message="Very close\nto a singularity"))
    assert topic.faults(clock.now()) == [f"{TOPIC}: Very close to a singularity"]
    ros.take(SimpleNamespace(code=0, message="No warnings"))
    assert topic.faults(clock.now()) == []


def test_a_number_alone_is_shown_as_it_is() -> None:
    ros, topic = status(ServoStatus(message="Int8"))
    assert ros.message_name == "std_msgs/msg/Int8"
    ros.take(SimpleNamespace(data=-1))
    assert topic.faults(clock.now()) == [f"{TOPIC}: MoveIt Servo reports status -1"]


def test_a_silent_status_is_a_fault() -> None:
    _, topic = status(ServoStatus(timeout=1.0))
    assert topic.faults(clock.now()) == [f"{TOPIC}: no message has arrived yet"]
