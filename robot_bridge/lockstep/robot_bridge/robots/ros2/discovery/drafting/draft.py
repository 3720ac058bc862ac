"""Drafts a robot's file from a graph, asking for what the graph does not say. No I/O besides the questions."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.robot_bridge.errors import BridgeError
from lockstep.robot_bridge.robots.ros2.discovery.drafting.choice import choose_robot
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_arm import draft_arm
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_base import draft_base
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_bodies import (
    BASE_BODY,
    LINK_PREFIX,
    FindMesh,
    draft_bodies,
)
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_calibration import Places
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_map import draft_map
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_sensors import draft_cameras, draft_ranges, draft_wrench
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_servers import (
    draft_actions,
    draft_grippers,
    draft_services,
)
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_status import draft_batteries, draft_diagnostics
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import CHECK, Section, Value, comment, render
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, parts_of_name
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask
from lockstep.robot_bridge.robots.ros2.discovery.urdf import BadUrdf, Urdf, parse_urdf

__all__ = ["Draft", "NothingToDrive", "draft"]

HOLD = 0.5  # s
LONGEST_HOLD = 5.0  # s
MAX_SEEN = 100  # topics in the list at the end


class NothingToDrive(BridgeError):
    name = "nothing_to_drive"


class Draft(NamedTuple):
    text: str  # the file
    without_bodies: str  # the same, if the description gets too long with them; "": there are none
    remarks: list[str]
    guesses: int  # lines that begin their comment with CHECK


def draft(
    graph: Graph,
    ask: Ask,
    namespace: str | None,
    domain: int | None = None,
    find_mesh: FindMesh = lambda name, most: None,
) -> Draft:
    """Return a robot's file. `find_mesh`: of a mesh of the URDF, by its name.

    Raises:
        NothingToDrive: nobody takes commands, or nothing says where the robot is.
        SeveralRobots: there are several, none was named, and nobody is asked.
    """
    graph, namespace = choose_robot(graph, ask, namespace)
    urdf, remarks = _urdf(graph)
    base, base_remarks = draft_base(graph, ask)
    arm, arm_remarks = draft_arm(graph, ask, urdf)
    remarks += base_remarks + arm_remarks
    if base is None and not arm:
        raise NothingToDrive(_nothing(graph, namespace, remarks))
    simulated = bool(graph.topics.get("/clock") and graph.topics["/clock"].publishers)
    bodies = None if urdf is None else draft_bodies(urdf, _names(arm), find_mesh, has_base=base is not None)
    cameras, camera_remarks = draft_cameras(graph, simulated, _places(graph, urdf, bodies, arm, base))
    remarks += camera_remarks
    ranges, scanner = draft_ranges(graph, ask, urdf, has_base=base is not None)
    top = _top(graph, ask, namespace, domain, urdf, base, simulated)
    parts = {"base": base, **arm, "ranges": ranges, "wrench": draft_wrench(graph, ask), "cameras": cameras}
    if scanner is not None:
        parts["bodies"] = Section(items=[scanner])
    top.values |= {key: section for key, section in parts.items() if section is not None}
    remarks += _draft_more(top, graph, ask, urdf, base)
    head, end = _head(graph, namespace), _end(graph, remarks)
    if bodies is None:
        text = head + render(top) + end
        return Draft(text, "", remarks, _guesses(text))
    top.values.pop("cameras", None)
    without, _ = draft_cameras(graph, simulated)  # no calibration: it names a body
    plain = head + render(Section(values=top.values | ({} if without is None else {"cameras": without}))) + end
    if cameras is not None:
        top.values["cameras"] = cameras
    bodies.items += [] if scanner is None else [scanner]
    top.values["bodies"] = bodies
    text = head + render(top) + end
    return Draft(text, plain, remarks, _guesses(text))


def _places(
    graph: Graph, urdf: Urdf | None, bodies: Section | None, arm: dict[str, Section], base: Section | None
) -> Places:
    """Return what says where the frames of cameras are."""
    named = [] if bodies is None else [str(row.value["name"]) for row in bodies.items if isinstance(row.value, dict)]
    root = BASE_BODY if base is not None else ""
    links = {name: name for name in named}
    if root and f"{LINK_PREFIX}{root}" in named:
        links = {name.removeprefix(LINK_PREFIX): name for name in named}
    return Places(graph, urdf, links, _names(arm), root)


def _draft_more(top: Section, graph: Graph, ask: Ask, urdf: Urdf | None, base: Section | None) -> list[str]:
    """Add the map, the actions and the status; return remarks."""
    drafted = {
        "map": (None, []) if base is None else draft_map(graph, ask, _odometry(base)),
        "services": draft_services(graph, ask),
        "actions": draft_actions(graph, ask),
        "grippers": draft_grippers(graph, ask, urdf),
        "batteries": (draft_batteries(graph), []),
        "diagnostics": (draft_diagnostics(graph, ask), []),
    }
    remarks = list[str]()
    for key, (section, said) in drafted.items():
        remarks += said
        if section is not None:
            top.values[key] = section
    return remarks


def _odometry(base: Section) -> str:
    """Return the topic of the drafted base's odometry."""
    odometry = base.values["odometry"]
    topic = odometry.values["topic"] if isinstance(odometry, Section) else odometry
    return str(topic.value) if isinstance(topic, Value) else ""


def _guesses(text: str) -> int:
    return sum(f"# {CHECK}" in line for line in text.splitlines()[2:])  # the head explains the word


def _names(arm: dict[str, Section]) -> set[str]:
    """Return the names of the joints that the description will have."""
    names = set[str]()
    for joints in (section.values["joints"] for section in arm.values()):
        if isinstance(joints, Section):
            names |= {str(row.value["name"]) for row in joints.items if isinstance(row.value, dict)}
        elif isinstance(joints.value, list):
            names |= set(map(str, joints.value))
    return names


def _urdf(graph: Graph) -> tuple[Urdf | None, list[str]]:
    """Return the robot's URDF: of the topic with the shortest name that has one."""
    remarks = []
    for name in sorted(graph.descriptions, key=lambda name: (len(name), name)):
        if not graph.descriptions[name]:
            remarks.append(f"{name} is published, but no message came")
            continue
        try:
            return parse_urdf(graph.descriptions[name]), []
        except BadUrdf as error:
            remarks.append(f"{name} {error}: it is not used")
    return None, remarks


def _nothing(graph: Graph, namespace: str, remarks: Sequence[str]) -> str:
    where = "" if namespace == "/" else f" below {namespace}"
    seen = ", ".join(sorted(graph.topics)[:12]) or "nothing"
    kinds = "Twist, TwistStamped, JointTrajectory, velocities of joints or a JointState of commands"
    why = "; ".join(remarks) or f"no node subscribes to {kinds}"
    return f"there is nothing to drive{where}: {why}. Seen: {seen}"


def _head(graph: Graph, namespace: str) -> str:
    where = "the whole graph" if namespace == "/" else f"the namespace {namespace}"
    lines = (
        f"Written by lockstep ros2 discover, from {where}, in {graph.seconds:.0f} s.",
        f"A comment that begins with {CHECK} marks a guess. Every setting is explained in docs/ros2.md.",
        "",
    )
    return "\n".join(comment(line) if line else "" for line in lines) + "\n"


def _top(
    graph: Graph,
    ask: Ask,
    namespace: str,
    domain: int | None,
    urdf: Urdf | None,
    base: Section | None,
    simulated: bool,
) -> Section:
    parts = parts_of_name(namespace)
    name = parts[-1] if parts else (urdf.name if urdf is not None and urdf.name else "robot")
    clean = re.sub(r"[^A-Za-z0-9_.-]+", "-", name)[:100]
    top = Section(values={"name": Value(clean, "stable: recordings and a latched STOP are kept by it")})
    if domain is not None:
        top.values["domain"] = Value(domain)
    if simulated:
        top.values["use_sim_time"] = Value(True, "a simulation publishes /clock")
    hold = ask.number("A command is held without another one for so long, s", HOLD, 0.1, LONGEST_HOLD)
    timeouts = [graph.parameter(topic.subscribers, "cmd_vel_timeout") for topic in graph.topics.values()]
    own = next((value for value in timeouts if isinstance(value, float)), None)
    note = "s that a command is held"
    if own is not None:
        note += f"; the controller's own cmd_vel_timeout is {own:g} s"
        note += "" if 0 < own <= hold else ", which should be above 0 and at most this"
    elif base is not None:
        note += "; the base's own controller needs a timeout of at most this"
    top.values["hold"] = Value(hold, note, not ask.answers or (base is not None and not (own and own <= hold)))
    return top


def _end(graph: Graph, remarks: Sequence[str]) -> str:
    lines = [*(comment(remark) for remark in remarks), *([""] if remarks else [])]
    lines.append(comment("All topics that were seen: name, messages, publishers, subscribers."))
    for name in sorted(graph.topics)[:MAX_SEEN]:
        topic = graph.topics[name]
        heard = graph.said(name)
        rate = f", {heard.rate:.3g} Hz" if heard.rate is not None else ""
        offered = {("reliable" if each.reliable else "best effort") for each in topic.publishers}
        offered |= {"transient local" for each in topic.publishers if each.kept}
        quality = f" ({', '.join(sorted(offered))})" if offered else ""
        kinds = ", ".join(topic.kinds())
        lines.append(comment(f"  {name}: {kinds}, {len(topic.publishers)}{quality}, {len(topic.subscribers)}{rate}"))
    if len(graph.topics) > MAX_SEEN:
        lines.append(comment(f"  and {len(graph.topics) - MAX_SEEN} more"))
    return "\n" + "\n".join(lines) + "\n"
