"""Chooses among topics: the likely one first, and a question where there are several."""

from collections.abc import Callable, Sequence

from lockstep.robot_bridge.errors import BridgeError
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Topic, namespace_of, parts_of_name
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import COMMANDS, JOINT_STATE, ODOMETRY
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask

__all__ = ["SeveralRobots", "choose_robot", "choose_topic", "robots"]

MAX_OPTIONS = 20


class SeveralRobots(BridgeError):
    name = "several_robots"


def robots(graph: Graph) -> list[str]:
    """Return the namespaces of the robots: each has commands and a state of its own. Empty: the graph is one robot."""
    states = {_top(topic) for kind in (ODOMETRY, JOINT_STATE) for topic in graph.published(kind)}
    commands = {_top(topic) for kind in COMMANDS for topic in graph.taken(kind)}
    commands |= {_top(topic) for topic in graph.joint_commands()}
    found = sorted(states & commands - {""})
    return [f"/{name}" for name in found] if len(found) > 1 else []


def choose_robot(graph: Graph, ask: Ask, namespace: str | None) -> tuple[Graph, str]:
    """Return the part of the graph that is the wanted robot, and its namespace; "/" for the whole graph.

    Raises:
        SeveralRobots: there is nobody to ask for one of them. To guess would be to drive another robot.
    """
    if namespace is None:
        found = robots(graph)
        if found and not ask.answers:
            raise SeveralRobots(
                f"there are several robots: {', '.join(found[:MAX_OPTIONS])}. Name one with --namespace"
            )
        namespace = found[ask.choose("There are several robots. Which one?", found)] if found else "/"
    namespace = "/" + namespace.strip("/")
    return graph.within(namespace), namespace


def choose_topic(
    question: str, topics: Sequence[Topic], ask: Ask, rank: Callable[[Topic], tuple[object, ...]]
) -> tuple[Topic, list[str]] | None:
    """Return one of the topics and the names of the others; None if there is none. The lowest rank is the default."""
    ordered = sorted(topics, key=lambda topic: (*rank(topic), len(topic.name), topic.name))[:MAX_OPTIONS]
    if not ordered:
        return None
    number = ask.choose(question, [_option(topic) for topic in ordered]) if len(ordered) > 1 else 0
    return ordered[number], [topic.name for topic in ordered if topic is not ordered[number]]


def _option(topic: Topic) -> str:
    kinds = ", ".join(kind.rpartition("/")[2] for kind in topic.kinds())
    return f"{topic.name}  ({kinds}; published by {len(topic.publishers)}, taken by {len(topic.subscribers)})"


def _top(topic: Topic) -> str:
    parts = parts_of_name(namespace_of(topic.name))
    return parts[0] if parts else ""
