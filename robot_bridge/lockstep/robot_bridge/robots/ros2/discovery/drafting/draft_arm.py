"""Drafts the `arm` of a robot's file, or its `servo`."""

from typing import NamedTuple

from lockstep.robot_bridge.robots.ros2.discovery.drafting.choice import choose_topic
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_servo import SERVO_LEAF, draft_servo, states_section
from lockstep.robot_bridge.robots.ros2.discovery.drafting.notes import others
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain, Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Topic
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import FLOATS, JOINT_STATE, TRAJECTORY, TWIST_STAMPED
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Urdf, UrdfJoint

__all__ = ["draft_arm"]

TURNING, SLIDING = 0.3, 0.05  # rad/s and m/s, where the robot's own limit is not slower
FASTEST = 20.0
MARGIN, MARGIN_SHARE = 0.05, 0.05  # rad or m kept from a joint's limits, at most this share of its range
MAX_JOINTS = 64
MESSAGES = {  # of commands, the likeliest first, with what they say
    TRAJECTORY: "",
    FLOATS: "velocities, in the order of `joints`",
    JOINT_STATE: "positions and velocities; nothing tells that its taker moves the joints to them",
}
_NO_ARM = ("wheel", "gripper", "finger", "caster")  # in names of joints that an arm's controller seldom moves


class _Joints(NamedTuple):
    names: list[str]
    source: str  # where the names are from, for the comment
    guess: bool


def draft_arm(graph: Graph, ask: Ask, urdf: Urdf | None) -> tuple[dict[str, Section], list[str]]:
    """Return the section `arm` or `servo`, nothing without an arm, and remarks for the person."""
    takers = graph.taken(TRAJECTORY)
    takers += [topic for topic in graph.taken(FLOATS) if _takes_velocities(graph, topic) and topic not in takers]
    takers += [topic for topic in graph.taken(TWIST_STAMPED) if topic.leaf == SERVO_LEAF]
    takers += graph.joint_commands()
    command = choose_topic("Which topic drives the arm?", takers, ask, _rank)
    if command is None:
        return {}, []
    topic = command[0]
    states = choose_topic(
        "Which joint states are the arm's?",
        graph.published(JOINT_STATE),
        ask,
        lambda each: (not graph.said(each.name).count, each.name.rpartition("/")[2] != "joint_states"),
    )
    if states is None:
        return {}, [f"{topic.name} takes commands of an arm, but no joint states are published: there is no arm"]
    joints = _joints(graph, topic, states[0], urdf)
    if not joints.names or (joints.guess and topic.takes(FLOATS)):
        return {}, [f"{topic.name}: which joints it moves, and in what order, could not be found out: there is no arm"]
    if topic.takes(TWIST_STAMPED):
        return {"servo": draft_servo(graph, ask, joints.names, command, states)}, []
    return {"arm": _section(graph, ask, urdf, joints, command, states)}, []


def _section(
    graph: Graph,
    ask: Ask,
    urdf: Urdf | None,
    joints: _Joints,
    command: tuple[Topic, list[str]],
    states: tuple[Topic, list[str]],
) -> Section:
    topic, other = command
    kind = next(kind for kind in MESSAGES if topic.takes(kind))
    node = next(each.node for each in topic.subscribers if each.kind == kind)
    section = Section()
    section.values["command"] = Section(
        values={
            "topic": Value(
                topic.name, f"taken by {node}{others(other)}", kind == JOINT_STATE or (bool(other) and not ask.answers)
            ),
            "message": Value(kind.rpartition("/")[2], MESSAGES[kind]),
        }
    )
    section.values["states"] = states_section(graph, states)
    asked = ask.number("Fastest joint of the arm, rad/s", TURNING, 1e-3, FASTEST)
    known = {} if urdf is None else urdf.joints
    rows = Section(items=[_row(name, known.get(name), asked, ask) for name in joints.names])
    rows.head.append(f"Names {joints.source}. maximum: rad/s, or m/s of a sliding joint.")
    if joints.guess:
        rows.head.append("CHECK: the controller has to move exactly these joints.")
    section.values["joints"] = rows
    return section


def _row(name: str, joint: UrdfJoint | None, asked: float, ask: Ask) -> Value:
    slides = joint is not None and joint.kind == "prismatic"
    speed = min(asked, SLIDING) if slides else asked
    unit = "m" if slides else "rad"
    row: dict[str, Plain] = {"name": name}
    note = "not in the URDF: no limits"
    if joint is not None:
        note = f"URDF: {joint.velocity:g} {unit}/s" if joint.velocity else "URDF: no velocity"
        speed = min(speed, joint.velocity) if joint.velocity and joint.velocity > 0 else speed
    if slides:
        row["unit"] = "m"
    row["maximum"] = speed
    if joint is not None and joint.lower is not None and joint.upper is not None and joint.lower < joint.upper:
        margin = min(MARGIN, MARGIN_SHARE * (joint.upper - joint.lower))
        row |= {"lower": joint.lower, "upper": joint.upper, "margin": margin}
        note += f", {joint.lower:.4g} to {joint.upper:.4g} {unit}"
    return Value(row, note if ask.answers else f"{note}; the speed is a careful guess", not ask.answers)


def _joints(graph: Graph, topic: Topic, states: Topic, urdf: Urdf | None) -> _Joints:
    """Return the joints that the controller moves, in its own order: a controller refuses others."""
    named = graph.parameter(topic.subscribers, "joints")
    if isinstance(named, list) and named:
        return _Joints(
            named[:MAX_JOINTS], f"and order are the parameter `joints` of {topic.subscribers[0].node}", False
        )
    seen = [name for name in graph.said(states.name).joints if not any(word in name.lower() for word in _NO_ARM)]
    if urdf is not None:
        movable = ("revolute", "continuous", "prismatic")
        seen = [name for name in seen if name in urdf.joints and urdf.joints[name].kind in movable]
        seen = [name for name in seen if not urdf.joints[name].mimics]
    return _Joints(seen, f"are those of {states.name} that look like an arm's", True)


def _takes_velocities(graph: Graph, topic: Topic) -> bool:
    """Whether the numbers are velocities: to a controller of positions they would be a leap."""
    interface = graph.parameter(topic.subscribers, "interface_name")
    return interface == "velocity" if interface is not None else "velocity" in topic.name.lower()


def _rank(topic: Topic) -> tuple[object, ...]:
    return (topic.takes(JOINT_STATE), topic.takes(TWIST_STAMPED), not topic.takes(TRAJECTORY), _is_gripper(topic))


def _is_gripper(topic: Topic) -> bool:
    return any(word in topic.name.lower() for word in _NO_ARM)
