"""A command topic without a ROS."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from lockstep.robot_bridge.robots.ros2.drives.command_stream import Said
from lockstep.robot_bridge.robots.ros2.drives.command_topic import LOOK_INTERVAL, CommandTopic
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide


class Twist:
    pass


class Publisher:
    topic_name = "/base/cmd_vel"

    def __init__(self) -> None:
        self.published: list[Any] = []
        self.listeners = 0
        self.fails = False

    def publish(self, message: Any) -> None:
        if self.fails:
            raise OSError("the middleware is gone")
        self.published.append(message)

    def get_subscription_count(self) -> int:
        return self.listeners


def topic() -> tuple[Publisher, CommandTopic]:
    publisher = Publisher()
    ros = SimpleNamespace(publisher=lambda kind, name: publisher)
    return publisher, CommandTopic(cast(RosSide, ros), Twist, "cmd_vel")


def test_a_topic_that_no_node_listens_to_is_a_fault_that_names_the_message() -> None:
    publisher, commands = topic()
    assert commands.full_name == "/base/cmd_vel"
    assert not commands.look(1.0)
    assert commands.faults() == ["cmd_vel: no subscriber for Twist"]
    publisher.listeners = 1
    assert not commands.look(1.0 + LOOK_INTERVAL / 2), "it looks at intervals"
    assert commands.look(1.01 + LOOK_INTERVAL)
    assert commands.faults() == []


def test_a_zero_is_owed_after_every_other_message_and_after_one_whose_publishing_failed() -> None:
    publisher, commands = topic()
    owed = []
    for message, said in ((None, Said.NOTHING), ("values", Said.VALUES), ("zero", Said.ZERO)):
        commands.publish(message, said)
        owed.append(commands.owes_zero)
    assert owed == [False, True, False]
    publisher.fails = True
    with pytest.raises(OSError, match="middleware"):
        commands.publish("zero", Said.ZERO)
    assert commands.owes_zero
    assert publisher.published == ["values", "zero"]


def test_a_zero_from_another_thread_leaves_the_ticks_their_own() -> None:
    publisher, commands = topic()
    commands.publish("values", Said.VALUES)
    commands.publish_from_thread("zero")
    assert publisher.published == ["values", "zero"]
    assert commands.owes_zero
