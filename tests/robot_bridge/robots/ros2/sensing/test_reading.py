"""A topic with one value as an item of the status, without a ROS."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lockstep.protocol.actions import StatusItem, fits_kind
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.reading import ReadingTopic
from lockstep.robot_bridge.robots.ros2.settings import Reading


class OneTopic:
    """Stands for the side of ROS: keeps what would be called with a message."""

    def interface(self, name: str) -> str:
        return name

    def subscribe(self, message: str, topic: str, take: Callable[[Any], None]) -> None:
        self.message, self.take = message, take


def shown(data: object, **settings: Any) -> list[StatusItem]:
    ros = OneTopic()
    topic = ReadingTopic(cast(RosSide, ros), Reading(topic="/x", name="x", **settings))
    stamp = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=0))
    ros.take(SimpleNamespace(data=data, temperature=data, header=stamp))
    items = topic.items(clock.now())
    assert all(map(fits_kind, items))
    return items


@pytest.mark.parametrize(
    ("message", "data", "kind", "value", "unit"),
    [
        ("String", "AUTO\x1b[31m\n x", "mode", "AUTO[31m x", ""),
        ("Bool", True, "switch", True, ""),
        ("Float64", 2.5, "number", 2.5, ""),
        ("Int32", 7, "number", 7.0, ""),
        ("Temperature", 41.5, "temperature", 41.5, "°C"),
    ],
)
def test_a_reading_is_shown_as_its_message_says(message: Any, data: Any, kind: str, value: object, unit: str) -> None:
    (item,) = shown(data, message=message)
    assert (item.kind, item.value, item.unit, item.level, item.label) == (kind, value, unit, "ok", "x")


def test_a_number_above_its_limits_is_a_warning_and_then_an_error_in_words() -> None:
    limits = {"message": "Float32", "warning": 60.0, "error": 80.0}
    assert [(each.level, each.text) for each in shown(60.0, **limits)] == [("ok", "")]
    assert [(each.level, each.text) for each in shown(61.0, **limits)] == [("warning", "above 60")]
    assert [(each.level, each.text) for each in shown(81.0, **limits)] == [("error", "above 80")]


@pytest.mark.parametrize("data", [math.nan, math.inf, 1e300])
def test_what_is_no_number_is_not_shown(data: float) -> None:
    assert shown(data, message="Float64") == []


def test_a_topic_that_never_spoke_is_not_shown_and_one_that_fell_silent_gets_older() -> None:
    ros = OneTopic()
    topic = ReadingTopic(cast(RosSide, ros), Reading(topic="/x", name="x", timeout=2.0))
    assert topic.items(clock.now()) == []
    ros.take(SimpleNamespace(data="AUTO"))
    (item,) = topic.items(clock.now() + 3.0)
    assert item.age >= 3.0
    assert item.old_after == 2.0
