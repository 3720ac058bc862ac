"""Looks at a live graph for some seconds: topics, what their messages say, parameters of the nodes that take commands.

Bounded in everything: topics, listeners, the time that it takes.
"""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from lockstep.robot_bridge.errors import BridgeError, RobotUnavailable
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, ParameterValue, Topic
from lockstep.robot_bridge.robots.ros2.discovery.graph_side import GraphSide
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import (
    COMMANDS,
    DESCRIPTION,
    FRAMES,
    GRIPPER,
    KEPT,
    SENSORS,
    SERVO_COMMAND_TYPE,
)
from lockstep.robot_bridge.robots.ros2.discovery.pose import Pose
from lockstep.robot_bridge.robots.ros2.discovery.topic_messages import TopicMessages
from lockstep.robot_bridge.robots.ros2.ros_side import header_ns

__all__ = ["EmptyGraph", "look"]

EVERY = 0.2  # s between looks
FIRST_TOPIC = 10.0  # s to wait for any topic at all
MAX_TOPICS = 1000
MAX_LISTENERS = 60
MAX_ASKED = 20  # nodes whose parameters are read
MAX_FRAMES = 1024
WANTED = (
    SERVO_COMMAND_TYPE,
    *("joints", "joint", "interface_name", "cmd_vel_timeout", "base_frame_id"),
    *("linear.x.max_velocity", "linear.x.min_velocity", "linear.y.max_velocity", "angular.z.max_velocity"),
)


class EmptyGraph(BridgeError):
    name = "empty_graph"


class _Listening:
    """The subscriptions of a look, and what they heard; the callbacks run in the node's thread."""

    def __init__(self, ros: GraphSide) -> None:
        self._ros = ros
        self.messages: dict[str, TopicMessages] = {}
        self.descriptions: dict[str, str] = {}
        self.frames: dict[str, str] = {}
        self.mounts: dict[str, tuple[str, Pose]] = {}
        self._follows_frames: set[str] = set()

    def follow(self, topics: dict[str, Topic]) -> None:
        """Listen to sensors that came since the last call."""
        for topic in topics.values():
            for kind in SENSORS:
                if topic.publishes(kind) and topic.name not in self.messages and len(self.messages) < MAX_LISTENERS:
                    self.messages[topic.name] = TopicMessages()
                    kept = kind in KEPT and any(each.kept for each in topic.publishers)
                    self._listen(kind, topic.name, partial(self._take, self.messages[topic.name]), kept)
            if topic.name in ("/tf", "/tf_static") and topic.publishes(FRAMES):
                self._follow_frames(topic.name)
            is_new = topic.name not in self.descriptions and len(self.descriptions) < MAX_LISTENERS
            if topic.name.endswith("/robot_description") and topic.publishes(DESCRIPTION) and is_new:
                self.descriptions[topic.name] = ""
                self._listen(DESCRIPTION, topic.name, partial(self._take_text, topic.name), kept=True)

    def _listen(self, kind: str, topic: str, callback: Callable[[Any], None], kept: bool = False) -> None:
        self._ros.listen(self._ros.interface(kind), topic, callback, kept)

    def _follow_frames(self, topic: str) -> None:
        if topic in self._follows_frames:
            return
        self._follows_frames.add(topic)
        static = topic == "/tf_static"
        with suppress(RobotUnavailable):  # without tf2_msgs the bridge cannot read them either
            self._listen(FRAMES, topic, partial(self._take_frames, static), kept=static)

    def _take_frames(self, static: bool, message: Any) -> None:
        for each in message.transforms:
            parent, child = str(each.header.frame_id).lstrip("/"), str(each.child_frame_id).lstrip("/")
            if not parent or not child or (child not in self.frames and len(self.frames) >= MAX_FRAMES):
                continue
            self.frames[child] = parent
            move, turn = each.transform.translation, each.transform.rotation
            numbers = (move.x, move.y, move.z, turn.w, turn.x, turn.y, turn.z)
            if static and all(map(math.isfinite, numbers)) and any(numbers[3:]):
                self.mounts[child] = parent, Pose((move.x, move.y, move.z), (turn.w, turn.x, turn.y, turn.z))

    def _take(self, messages: TopicMessages, message: Any) -> None:
        header = header_ns(message.header)
        messages.take(message, time.monotonic(), (self._ros.now_ns() - header) / 1e9 if header else None)

    def _take_text(self, topic: str, message: Any) -> None:
        self.descriptions[topic] = str(message.data)


def look(ros: GraphSide, seconds: float) -> Graph:
    """Look for so many seconds, and longer while the graph still grows (three times as long at most).

    Raises:
        EmptyGraph: nobody was found.
        RobotUnavailable: the package of a common message is missing, or the node ended.
    """
    listening = _Listening(ros)
    ros.start()
    began = changed = time.monotonic()
    topics: dict[str, Topic] = {}
    while True:
        if ros.failure is not None:
            raise RobotUnavailable(f"the ROS node ended: {ros.failure}") from ros.failure
        now = time.monotonic()
        found = {topic.name: topic for topic in ros.topics()[:MAX_TOPICS]}
        if found.keys() != topics.keys():
            changed = now
            began = now if not topics else began
        topics = found
        listening.follow(topics)
        if not topics and now - began > max(FIRST_TOPIC, seconds):
            raise EmptyGraph(
                "no topic of another node was found. Does the robot run? Does `ros2 topic list` show its topics here? "
                "Compare with the robot's: ROS_DOMAIN_ID, RMW_IMPLEMENTATION, ROS_AUTOMATIC_DISCOVERY_RANGE (or "
                "ROS_LOCALHOST_ONLY) and ROS_STATIC_PEERS"
            )
        if topics and now - began > seconds and (now - changed > 1.0 or now - began > 3 * seconds):
            break
        time.sleep(EVERY)
    services, actions = ros.servers()
    grippers = [each.node for each in actions if each.kind == GRIPPER]
    return Graph(
        topics=topics,
        heard={name: messages.heard() for name, messages in listening.messages.items()},
        parameters=_parameters(ros, topics, grippers),
        descriptions=dict(listening.descriptions),
        seconds=time.monotonic() - began,
        services=services,
        actions=actions,
        frames=dict(listening.frames),
        mounts=dict(listening.mounts),
    )


def _parameters(ros: GraphSide, topics: dict[str, Topic], more: list[str]) -> dict[str, dict[str, ParameterValue]]:
    nodes = {each.node: None for topic in topics.values() for each in topic.subscribers if each.kind in COMMANDS}
    nodes |= dict.fromkeys(more)
    return {node: ros.parameters(node, WANTED) for node in list(nodes)[:MAX_ASKED]}
