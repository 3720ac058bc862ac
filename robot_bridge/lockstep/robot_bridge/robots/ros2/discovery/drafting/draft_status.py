"""Drafts what a robot's file says of its status: batteries and diagnostics."""

from lockstep.robot_bridge.robots.ros2.discovery.drafting.choice import choose_topic
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_servers import unique_name
from lockstep.robot_bridge.robots.ros2.discovery.drafting.notes import rate_of, timeout_for
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain, Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import BATTERY, DIAGNOSTICS
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask

__all__ = ["draft_batteries", "draft_diagnostics"]

MAX_BATTERIES = 8
LEAST = 10.0  # s after which a reading is old


def draft_batteries(graph: Graph) -> Section | None:
    section = Section()
    names = set[str]()
    for topic in sorted(graph.published(BATTERY), key=lambda topic: topic.name)[:MAX_BATTERIES]:
        heard = graph.said(topic.name)
        row: dict[str, Plain] = {"topic": topic.name}
        name = unique_name("battery" if not names else topic.name, names)
        row |= {} if name == "battery" else {"name": name, "label": name}
        timeout = LEAST if heard.rate is None else timeout_for(heard.rate, LEAST)
        row |= {} if timeout == LEAST else {"timeout": timeout}
        section.items.append(Value(row, rate_of(heard, graph.seconds)))
    return section if section.items else None


def draft_diagnostics(graph: Graph, ask: Ask) -> Section | None:
    chosen = choose_topic(
        "Which diagnostics are shown?",
        graph.published(DIAGNOSTICS),
        ask,
        lambda topic: (not topic.name.endswith("/diagnostics"),),
    )
    return None if chosen is None else Section(values={"topic": Value(chosen[0].name)})
