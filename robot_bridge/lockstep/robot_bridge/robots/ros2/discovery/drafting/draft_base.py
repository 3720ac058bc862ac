"""Drafts the `base` of a robot's file."""

from lockstep.robot_bridge.robots.ros2.discovery.drafting.choice import choose_topic
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_servo import SERVO_LEAF
from lockstep.robot_bridge.robots.ros2.discovery.drafting.notes import others, rate_of, timeout_for
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Topic, namespace_of, parts_of_name
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import ODOMETRY, TWIST, TWIST_STAMPED
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask

__all__ = ["draft_base"]

FORWARD, TURN = 0.2, 0.5  # m/s and rad/s: a slow walk, where nothing says how fast the robot is
FASTEST_FORWARD, FASTEST_TURN = 20.0, 20.0
RADIUS = 0.3  # m


def draft_base(graph: Graph, ask: Ask) -> tuple[Section | None, list[str]]:
    """Return the section, or None without a base, and remarks for the person."""
    takers = [topic for kind in (TWIST_STAMPED, TWIST) for topic in graph.taken(kind)]
    takers = [topic for topic in dict.fromkeys(takers) if parts_of_name(topic.name)[-1] != SERVO_LEAF]
    command = choose_topic("Which topic drives the base?", takers, ask, _command_rank)
    if command is None:
        return None, []
    namespace = namespace_of(command[0].name)
    odometry = choose_topic(
        "Which odometry is the base's?",
        graph.published(ODOMETRY),
        ask,
        lambda topic: (not graph.said(topic.name).count, namespace_of(topic.name) != namespace, _leaf(topic) != "odom"),
    )
    if odometry is None:
        return None, [
            f"{command[0].name} takes twists, but no odometry is published: a base needs it, so there is none"
        ]
    return _section(graph, ask, command, odometry), []


def _section(graph: Graph, ask: Ask, command: tuple[Topic, list[str]], odometry: tuple[Topic, list[str]]) -> Section:
    topic, other_commands = command
    source, other_odometry = odometry
    heard = graph.said(source.name)
    section = Section()
    section.values["forward"] = _speed(graph, topic, ask, "forward", "linear.x.max_velocity", FORWARD)
    if (sideways := graph.parameter(topic.subscribers, "linear.y.max_velocity")) or (
        ask.answers and ask.agree("Can the base move sideways?", False)
    ):
        section.values["left"] = _speed(
            graph, topic, ask, "sideways", "linear.y.max_velocity" if sideways else "", FORWARD
        )
    section.values["turn"] = _speed(graph, topic, ask, "turning", "angular.z.max_velocity", TURN)
    radius = ask.number("Radius of the circle that holds the robot, m", RADIUS, 0.01, 10.0)
    section.values["radius"] = Value(radius, _said(ask, "m, of the circle that holds the whole robot"), not ask.answers)
    section.values["command"] = _command(graph, ask, topic, other_commands, heard.child_frame)
    stale = timeout_for(heard.rate)
    section.values["odometry"] = Section(
        values={
            "topic": Value(source.name, rate_of(heard, graph.seconds) + others(other_odometry), not heard.count),
            "timeout": Value(stale, "s without a message until the base must not move"),
        }
    )
    return section


def _command(graph: Graph, ask: Ask, topic: Topic, other: list[str], child_frame: str) -> Section:
    is_stamped = topic.takes(TWIST_STAMPED)
    node = next(each.node for each in topic.subscribers if each.kind == (TWIST_STAMPED if is_stamped else TWIST))
    note = f"taken by {node}{others(other)}"
    if topic.publishers:
        note += f"; {topic.publishers[0].node} publishes there too: use a mux if both drive"
    section = Section(values={"topic": Value(topic.name, note, bool(other) and not ask.answers)})
    if len({each.kind for each in topic.subscribers} & {TWIST, TWIST_STAMPED}) > 1:
        section.head.append("Subscribers take both Twist and TwistStamped here: ROS delivers to one kind only.")
    section.values["message"] = Value("TwistStamped" if is_stamped else "Twist", "as the subscriber takes it")
    if is_stamped:
        frame = graph.parameter(topic.subscribers, "base_frame_id")
        known = frame if isinstance(frame, str) and frame else child_frame
        section.values["frame"] = Value(known or "base_link", "" if known else "a guess", not known)
    return section


def _speed(graph: Graph, topic: Topic, ask: Ask, what: str, parameter: str, default: float) -> Value:
    """Return the fastest speed: of the controller's own parameters, else asked for, else a slow guess."""
    unit, most = ("rad/s", FASTEST_TURN) if what == "turning" else ("m/s", FASTEST_FORWARD)
    limit = graph.parameter(topic.subscribers, parameter)
    known = isinstance(limit, (int, float)) and 0 < limit <= most
    proposed = min(default, float(limit)) if known and isinstance(limit, (int, float)) else default
    speed = ask.number(f"Fastest {what}, {unit}", proposed, 1e-3, most)
    of_controller = f"; its controller allows {limit:g}" if known else ""
    return Value({"maximum": speed}, _said(ask, f"{unit}{of_controller}"), not ask.answers)


def _said(ask: Ask, text: str) -> str:
    return f"{text}, as you said" if ask.answers else f"{text}, a careful guess"


def _command_rank(topic: Topic) -> tuple[object, ...]:
    leaf = _leaf(topic)
    return (leaf != "cmd_vel", "cmd_vel" not in leaf, not topic.takes(TWIST_STAMPED), len(topic.publishers))


def _leaf(topic: Topic) -> str:
    return parts_of_name(topic.name)[-1]
