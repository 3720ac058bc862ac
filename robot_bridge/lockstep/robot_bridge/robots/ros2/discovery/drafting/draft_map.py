"""Drafts the `map` of a robot's file: the grid, where the odometry is on it, the path, and the goal."""

from lockstep.robot_bridge.robots.ros2.discovery.drafting.choice import choose_topic
from lockstep.robot_bridge.robots.ros2.discovery.drafting.notes import others
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Topic, parts_of_name
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import GRID, NAVIGATE, PATH, POSE, POSE_COVARIANCE
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask

__all__ = ["draft_map"]

MAX_STEPS = 64  # from a frame to its root


def draft_map(graph: Graph, ask: Ask, odometry: str) -> tuple[Section | None, list[str]]:
    """Return the section, None without a map, and remarks. `odometry`: the topic that the base's odometry is from."""
    chosen = choose_topic(
        "Which map is shown?",
        graph.published(GRID),
        ask,
        lambda topic: (_leaf(topic) != "map", "costmap" in topic.name, not graph.said(topic.name).count),
    )
    if chosen is None:
        return None, []
    topic, other = chosen
    heard = graph.said(topic.name)
    section = Section()
    section.values["topic"] = Value(topic.name, f"{others(other).removeprefix('; ')}")
    if not any(each.kept for each in topic.publishers):
        section.values["durable"] = Value(False, "its publisher keeps nothing for later subscribers")
    frame = heard.frame.lstrip("/") or "map"
    section.values["frame"] = Value(frame, "" if heard.frame else "no map came: a guess", not heard.frame)
    section.values["place"] = _place(graph, frame, graph.said(odometry).frame.lstrip("/") or "odom")
    paths = [each for each in graph.published(PATH) if "local" not in each.name]
    path = choose_topic("Which path is drawn?", paths, ask, lambda each: (_leaf(each) != "plan",))
    section.values["path"] = Value("" if path is None else path[0].name, "" if path is None else others(path[1])[2:])
    return section, _goal(section, graph, ask)


def _place(graph: Graph, frame: str, odometry: str) -> Section:
    """Return how the bridge knows where the frame of the odometry is on the map."""
    if odometry == frame:
        return Section(values={"source": Value("same", "the odometry is in the frame of the map")})
    up, down = _above(graph, odometry), _above(graph, frame)
    if set(up) & set(down):
        return Section(values={"source": Value("tf"), "odometry": Value(odometry, f"TF connects it with {frame}")})
    for kind in (POSE_COVARIANCE, POSE):
        topics = [each for each in graph.published(kind) if "pose" in _leaf(each) and "goal" not in _leaf(each)]
        for each in sorted(topics, key=lambda each: (_leaf(each) != "amcl_pose", each.name)):
            values: dict[str, Value | Section] = {
                "source": Value("topic"),
                "topic": Value(each.name, "the robot's pose on the map", True),
            }
            return Section(values=values | {"message": Value(kind.rpartition("/")[2])})
    note = f"TF does not connect it with {frame} now: the place is not known"
    return Section(values={"source": Value("tf"), "odometry": Value(odometry, note, True)})


def _above(graph: Graph, frame: str) -> list[str]:
    """Return a frame and those above it in TF; only the frame where TF does not know it."""
    names = [frame]
    while (parent := graph.frames.get(names[-1])) is not None and parent not in names and len(names) < MAX_STEPS:
        names.append(parent)
    return names


def _goal(section: Section, graph: Graph, ask: Ask) -> list[str]:
    """Add the action that drives to a place on the map, if a person wants it; a comment otherwise."""
    servers = sorted((each for each in graph.actions if each.kind == NAVIGATE), key=lambda each: (len(each.name), each))
    for server in servers[:1]:
        question = f"May a click on the map send the robot there, by {server.name}? It drives by itself"
        is_on = server.fields is not None and ask.answers and ask.agree(question, False)
        note = f"of {server.node}: a click on the map sends the robot there"
        if server.fields is None:
            note = "nav2_msgs is not installed here, as it has to be beside the bridge"
        section.values["goal"] = Value({"action": server.name}, note, off=not is_on)
        if not is_on:
            return [f"a goal on the map, by {server.name}, stands in the file, switched off"]
    return []


def _leaf(topic: Topic) -> str:
    return parts_of_name(topic.name)[-1]
