"""Drafts the `servo` of a robot's file, for MoveIt Servo."""

from lockstep.robot_bridge.robots.ros2.discovery.drafting.notes import others, rate_of, timeout_for
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Topic, namespace_of
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import INT8, SERVO_COMMAND_TYPE, SERVO_STATUS
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask

__all__ = ["SERVO_LEAF", "draft_servo", "states_section"]

SERVO_LEAF = "delta_twist_cmds"
LINEAR, ANGULAR = 0.05, 0.2  # m/s and rad/s
FASTEST = 5.0


def draft_servo(
    graph: Graph, ask: Ask, joints: list[str], command: tuple[Topic, list[str]], states: tuple[Topic, list[str]]
) -> Section:
    topic, other = command
    meaning = graph.parameter(topic.subscribers, SERVO_COMMAND_TYPE)
    section = Section()
    if meaning != "speed_units":
        said = "is not known" if meaning is None else f"is {meaning!r}"
        section.head.append(f"CHECK: Servo's parameter command_in_type {said}: it has to be speed_units.")
    for key, default, unit in (("linear", LINEAR, "m/s"), ("angular", ANGULAR, "rad/s")):
        speed = ask.number(f"Fastest {key} motion of the tool, {unit}", default, 1e-3, FASTEST)
        source = "as you said" if ask.answers else "a careful guess"
        section.values[key] = Value(speed, f"{unit}, {source}", not ask.answers)
    section.values["joints"] = Value(joints, f"of {states[0].name}", True)
    section.values["command"] = Section(
        values={
            "topic": Value(
                topic.name, f"taken by {topic.subscribers[0].node}{others(other)}", bool(other) and not ask.answers
            ),
            "frame": Value("base_link", "the axes of the twist: a guess", True),
        }
    )
    section.values["states"] = states_section(graph, states)
    status = graph.topics.get(f"{namespace_of(topic.name).rstrip('/')}/status")
    for kind in (SERVO_STATUS, INT8):
        if status is not None and status.publishes(kind):
            section.values["status"] = Section(
                values={"topic": Value(status.name), "message": Value(kind.rpartition("/")[2])}
            )
    return section


def states_section(graph: Graph, states: tuple[Topic, list[str]]) -> Section:
    """Return what says where the joints are."""
    topic, other = states
    heard = graph.said(topic.name)
    return Section(
        values={
            "topic": Value(topic.name, rate_of(heard, graph.seconds) + others(other), not heard.count),
            "timeout": Value(timeout_for(heard.rate), "s without a message until the arm must not move"),
        }
    )
