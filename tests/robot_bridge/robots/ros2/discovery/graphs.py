"""Graphs as they might be seen, and a person who answers."""

from collections.abc import Sequence

from lockstep.robot_bridge.robots.ros2.discovery.graph import Endpoint, Graph, Heard, Topic
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import ODOMETRY, TWIST_STAMPED

__all__ = ["Person", "base_graph", "published", "taken", "topics"]


def published(name: str, kind: str, node: str = "/driver") -> Topic:
    return Topic(name, publishers=(Endpoint(node, kind),))


def taken(name: str, kind: str, node: str = "/driver") -> Topic:
    return Topic(name, subscribers=(Endpoint(node, kind),))


def topics(*given: Topic) -> dict[str, Topic]:
    return {topic.name: topic for topic in given}


def base_graph(*more: Topic, namespace: str = "", kind: str = TWIST_STAMPED) -> Graph:
    """A base with odometry at 20 Hz."""
    odometry = f"{namespace}/odom"
    return Graph(
        topics(taken(f"{namespace}/cmd_vel", kind), published(odometry, ODOMETRY), *more),
        {odometry: Heard(count=80, rate=20.0, frame="odom", child_frame="base_footprint", stamped=True)},
        seconds=4.0,
    )


class Person:
    """Answers by the beginning of the question; what is not prepared gets the default."""

    answers = True

    def __init__(self, **prepared: float | bool) -> None:
        self._prepared = {key.replace("_", " "): value for key, value in prepared.items()}
        self.asked: list[str] = []

    def _answer(self, question: str, default: float | bool) -> float | bool:
        self.asked.append(question)
        return next((value for key, value in self._prepared.items() if question.startswith(key)), default)

    def choose(self, question: str, options: Sequence[str], default: int = 0) -> int:
        return int(self._answer(question, default))

    def number(self, question: str, default: float, low: float, high: float) -> float:
        return float(self._answer(question, default))

    def agree(self, question: str, default: bool) -> bool:
        return bool(self._answer(question, default))
