"""Drafts what a robot's file says of its sensors: laser scan, wrench, cameras."""

import math

from lockstep.robot_bridge.robots.ros2.discovery.drafting.choice import choose_topic
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_bodies import BASE_BODY
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_calibration import Places, calibration, info_topic
from lockstep.robot_bridge.robots.ros2.discovery.drafting.notes import others, rate_of, timeout_for
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain, Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Heard, Topic
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import COMPRESSED, IMAGE, SCAN, WRENCH
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Urdf
from lockstep.robot_bridge.robots.ros2.sensing.picture import ENCODINGS

__all__ = ["draft_cameras", "draft_ranges", "draft_wrench"]

MAX_CAMERAS = 8
MAX_FRAME_RATE, MIN_FRAME_RATE = 30.0, 0.1
MIN_SIDE, MAX_SIDE = 16, 8192
LEVEL = math.cos(math.radians(10))
BASE_FRAMES = ("base_link", "base_footprint")
SCANNER = "scanner"
COMPRESSED_END = "/compressed"


def draft_ranges(graph: Graph, ask: Ask, urdf: Urdf | None, *, has_base: bool) -> tuple[Section | None, Value | None]:
    """Return the section, and the body at the scanner's place where the URDF says that it is not the base's own."""
    chosen = choose_topic(
        "Which laser scan is drawn?", _speaking(graph, SCAN), ask, lambda topic: (not topic.name.endswith("/scan"),)
    )
    if chosen is None:
        return None, None
    topic, other = chosen
    heard = graph.said(topic.name)
    section = Section(values={"topic": Value(topic.name, rate_of(heard, graph.seconds) + others(other))})
    pose = None if urdf is None else urdf.pose(heard.frame)
    place: Value | None = None
    if urdf is not None and pose is not None and pose.upright >= LEVEL and any(map(abs, pose.position)):
        name = next(each for each in (SCANNER, f"{SCANNER}_") if each not in urdf.links)
        parent = BASE_BODY if has_base else ""
        place = Value({"name": name, "parent": parent, "position": list(pose.position)}, "where the scanner is")
        section.values["body"] = Value(name, "at its place in the URDF")
    section.values["timeout"] = Value(timeout_for(heard.rate, 1.0))
    section.values["yaw"] = _yaw(heard, urdf)
    if 0 <= heard.range_min < heard.range_max <= 1e6:
        section.values["range_min"] = Value(heard.range_min, "m, as its messages say")
        section.values["range_max"] = Value(heard.range_max)
    return section, place


def _yaw(heard: Heard, urdf: Urdf | None) -> Value:
    """Return how the scanner is turned in the base's frame, by the URDF."""
    if heard.frame in BASE_FRAMES:
        return Value(0, f"rad: frame {heard.frame!r} is the base's own")
    pose = None if urdf is None else urdf.pose(heard.frame)
    if urdf is None or pose is None:
        place = "without a URDF" if urdf is None else "not fixed in the URDF"
        return Value(0, f"rad: how frame {heard.frame!r} is turned is not known, {place}", True)
    if pose.upright < LEVEL:
        return Value(0, f"frame {heard.frame!r} is tilted or upside down in the URDF: its sides are wrong here", True)
    return Value(round(pose.yaw, 4) + 0.0, f"rad, of frame {heard.frame!r} in the URDF")


def draft_wrench(graph: Graph, ask: Ask) -> Section | None:
    chosen = choose_topic("Which force sensor is felt?", _speaking(graph, WRENCH), ask, lambda topic: ())
    if chosen is None:
        return None
    topic, other = chosen
    heard = graph.said(topic.name)
    return Section(
        values={
            "topic": Value(topic.name, rate_of(heard, graph.seconds) + others(other)),
            "timeout": Value(timeout_for(heard.rate)),
            "full_scale_force": Value(50, "N that are felt at their strongest: a guess", True),
        }
    )


def draft_cameras(graph: Graph, simulated: bool, places: Places | None = None) -> tuple[Section | None, list[str]]:
    """Return the cameras whose pictures the bridge can read, and remarks on those that it cannot.

    `places`: where frames are on the bodies; None: no calibration is written.
    """
    remarks = list[str]()
    items = list[Value]()
    names = set[str]()
    raw = [topic for topic in _speaking(graph, IMAGE) if graph.said(topic.name).encoding in ENCODINGS]
    raw_names = {topic.name for topic in raw}
    packed = [
        topic
        for topic in _speaking(graph, COMPRESSED)
        if topic.name.removesuffix(COMPRESSED_END) not in raw_names and "depth" not in topic.name.lower()
    ]
    for topic in sorted([*raw, *packed], key=lambda topic: topic.name):
        heard = graph.said(topic.name)
        if not (MIN_SIDE <= heard.width <= MAX_SIDE and MIN_SIDE <= heard.height <= MAX_SIDE):
            remarks.append(f"{topic.name}: pictures in {heard.encoding!r} of a size that cannot be shown")
        elif len(items) < MAX_CAMERAS:
            items.append(_camera(graph, topic, names, simulated, places, remarks))
        else:
            remarks.append(f"{topic.name}: more than {MAX_CAMERAS} cameras")
    remarks += [
        f"{topic.name}: pictures in encoding {graph.said(topic.name).encoding!r} are not shown"
        for topic in _speaking(graph, IMAGE)
        if topic.name not in raw_names
    ]
    return (Section(items=items) if items else None), remarks


def _camera(
    graph: Graph, topic: Topic, names: set[str], simulated: bool, places: Places | None, remarks: list[str]
) -> Value:
    heard = graph.said(topic.name)
    parts = [part for part in topic.name.split("/") if part not in ("", "compressed", "image_raw", "image", "color")]
    stem = "-".join(parts[-2:])[:80] or "camera"
    name = next(each for each in (stem, *(f"{stem}-{number}" for number in range(2, 100))) if each not in names)
    names.add(name)
    rate = min(max(heard.rate or 1.0, MIN_FRAME_RATE), MAX_FRAME_RATE)
    row: dict[str, Plain] = {
        "name": name,
        "topic": topic.name,
        "message": "Image" if topic.publishes(IMAGE) else "CompressedImage",
        "width": heard.width,
        "height": heard.height,
        "frame_rate": float(round(rate)) if rate >= 1 else rate,
    }
    if places is not None:
        found = calibration(graph, topic, heard.width, heard.height, places)
        if isinstance(found, dict):
            row["calibration"] = found
            row["info"] = info_topic(topic.name)
        elif found:
            remarks.append(found)
    note = f"{rate_of(heard, graph.seconds)}, {heard.encoding}"
    if simulated or not heard.stamped:
        row["captured"] = "arrival"
        reason = "simulated time" if simulated else "its stamps are not of this machine's clock"
        return Value(row, f"{note}; {reason}: set latency", True)
    return Value(row, note)


def _speaking(graph: Graph, kind: str) -> list[Topic]:
    return [topic for topic in graph.published(kind) if graph.said(topic.name).count]
