"""What was seen of a ROS 2 graph. No I/O, no clock."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import JOINT_STATE
from lockstep.robot_bridge.robots.ros2.discovery.pose import Pose
from lockstep.robot_bridge.robots.ros2.pinhole import Pinhole

__all__ = [
    "ActionFields",
    "ActionServer",
    "Endpoint",
    "Graph",
    "Heard",
    "ParameterValue",
    "ServiceServer",
    "Topic",
    "namespace_of",
    "parts_of_name",
]

ParameterValue = bool | int | float | str | list[str]


class Endpoint(NamedTuple):
    """One publisher or subscriber of a topic."""

    node: str  # "/robot1/diff_drive_controller"
    kind: str  # "geometry_msgs/msg/TwistStamped"
    reliable: bool = True
    kept: bool = False  # transient local: the last message reaches subscribers that come later


class Topic(NamedTuple):
    name: str  # "/robot1/cmd_vel"
    publishers: tuple[Endpoint, ...] = ()
    subscribers: tuple[Endpoint, ...] = ()

    def kinds(self) -> list[str]:
        return sorted({each.kind for each in (*self.publishers, *self.subscribers)})

    @property
    def leaf(self) -> str:
        """The last part of the name: "cmd_vel"."""
        return self.name.rpartition("/")[2]

    def publishes(self, kind: str) -> bool:
        return any(each.kind == kind for each in self.publishers)

    def takes(self, kind: str) -> bool:
        return any(each.kind == kind for each in self.subscribers)


class ServiceServer(NamedTuple):
    name: str  # "/light"
    kind: str  # "std_srvs/srv/SetBool"
    node: str


class ActionFields(NamedTuple):
    """The fields of an action's messages with their types: "order" is an "int32"."""

    goal: Mapping[str, str]
    result: Mapping[str, str]
    feedback: Mapping[str, str]


class ActionServer(NamedTuple):
    name: str  # "/dock_robot"
    kind: str  # "nav2_msgs/action/DockRobot"
    node: str
    fields: ActionFields | None = None  # None: the action is not installed where the look was taken


@dataclass(frozen=True)
class Heard:
    """What the messages of one topic said; a field that its kind of message does not have keeps its default."""

    count: int = 0
    rate: float | None = None  # Hz; None: fewer than two messages
    frame: str = ""  # header.frame_id
    child_frame: str = ""  # of Odometry
    joints: tuple[str, ...] = ()  # of JointState
    range_min: float = 0.0  # m, of LaserScan
    range_max: float = 0.0
    width: int = 0  # pixels; 0: not known
    height: int = 0
    encoding: str = ""
    stamped: bool = False  # every header's stamp was near this machine's clock
    pinhole: Pinhole | None = None  # of CameraInfo


@dataclass(frozen=True)
class Graph:
    topics: Mapping[str, Topic]
    heard: Mapping[str, Heard] = field(default_factory=dict)
    parameters: Mapping[str, Mapping[str, ParameterValue]] = field(default_factory=dict)  # by node
    descriptions: Mapping[str, str] = field(default_factory=dict)  # URDF by topic; "" while none came
    seconds: float = 0.0  # for which topics were listened to
    services: tuple[ServiceServer, ...] = ()
    actions: tuple[ActionServer, ...] = ()
    frames: Mapping[str, str] = field(default_factory=dict)  # of TF: the parent of each frame
    mounts: Mapping[str, tuple[str, Pose]] = field(
        default_factory=dict
    )  # those that never move: parent, and pose in it

    def published(self, kind: str) -> list[Topic]:
        """Return the topics on which messages of a kind are published."""
        return [topic for topic in self.topics.values() if topic.publishes(kind)]

    def taken(self, kind: str) -> list[Topic]:
        """Return the topics whose subscribers take messages of a kind."""
        return [topic for topic in self.topics.values() if topic.takes(kind)]

    def joint_commands(self) -> list[Topic]:
        """Return the topics on which joint states are taken as commands: nobody says there what the joints are."""
        return [
            topic for topic in self.taken(JOINT_STATE) if not topic.publishers and "state" not in topic.leaf.lower()
        ]

    def said(self, topic: str) -> Heard:
        """Return what the topic's messages said; empty for a topic that was silent."""
        return self.heard.get(topic, Heard())

    def parameter(self, nodes: tuple[Endpoint, ...], name: str) -> ParameterValue | None:
        """Return a parameter of the first of these nodes that has it."""
        for each in nodes:
            if (value := self.parameters.get(each.node, {}).get(name)) is not None:
                return value
        return None

    def within(self, namespace: str) -> "Graph":
        """Return the part below a namespace, such as "/robot1"; "/" is everything. `/clock` stays."""
        prefix = namespace.rstrip("/") + "/"
        return Graph(
            {name: topic for name, topic in self.topics.items() if name.startswith(prefix) or name == "/clock"},
            self.heard,
            self.parameters,
            {name: text for name, text in self.descriptions.items() if name.startswith(prefix)},
            self.seconds,
            tuple(each for each in self.services if each.name.startswith(prefix)),
            tuple(each for each in self.actions if each.name.startswith(prefix)),
            self.frames,
            self.mounts,
        )


def parts_of_name(name: str) -> list[str]:
    """Return the parts of a topic's name: "/robot1/cmd_vel" has "robot1" and "cmd_vel"."""
    return [part for part in name.split("/") if part]


def namespace_of(name: str) -> str:
    """Return the namespace that a topic is in: "/robot1/cmd_vel" is in "/robot1", "/cmd_vel" in "/"."""
    return "/" + "/".join(parts_of_name(name)[:-1])
