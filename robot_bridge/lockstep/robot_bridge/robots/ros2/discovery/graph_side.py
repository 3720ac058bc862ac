"""A ROS 2 node that looks and listens: it has no publisher of its own and calls only services that read parameters."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.ros2.discovery.graph import (
    ActionFields,
    ActionServer,
    Endpoint,
    ParameterValue,
    ServiceServer,
    Topic,
)
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import SERVICES
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Ros2Settings

__all__ = ["NODE", "GraphSide"]

NODE = "lockstep_discover"
DEPTH = 20  # messages that wait for the callback, so that rates are counted
OWN_TOPICS = ("/parameter_events", "/rosout")  # every node has them
SERVICE_SECONDS = 2.0
MAX_NODES = 200
MAX_SERVERS = 200  # services, and actions
MAX_FIELDS = 40  # of a message

# rcl_interfaces/ParameterType -> the field that holds the value
_FIELDS = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value", 9: "string_array_value"}


class GraphSide(RosSide):
    """What `Ros2Settings` says of a node, with another name."""

    def __init__(self, domain: int | None) -> None:
        """Make the node.

        Raises:
            RobotUnavailable: as for `RosSide`.
        """
        super().__init__(Ros2Settings(name=NODE, node=NODE, domain=domain))
        self._services = import_module("rcl_interfaces.srv")
        self._action_graph = import_module("rclpy.action")

    def topics(self) -> list[Topic]:
        """Return the topics of other nodes, as far as they are known by now."""
        found = []
        for name, _ in self._node.get_topic_names_and_types():
            if name in OWN_TOPICS:
                continue
            publishers = _endpoints(self._node.get_publishers_info_by_topic(name))
            subscribers = _endpoints(self._node.get_subscriptions_info_by_topic(name))
            if publishers or subscribers:
                found.append(Topic(str(name), publishers, subscribers))
        return found

    def servers(self) -> tuple[tuple[ServiceServer, ...], tuple[ActionServer, ...]]:
        """Return the services that an action of the robot may be, and the action servers, of other nodes."""
        services: dict[str, ServiceServer] = {}
        actions: dict[str, ActionServer] = {}
        for node, namespace in sorted(self._node.get_node_names_and_namespaces())[:MAX_NODES]:
            if node == NODE:
                continue
            full = f"{namespace.rstrip('/')}/{node}"
            offered: list[tuple[str, list[str]]] = []
            acts: list[tuple[str, list[str]]] = []
            with suppress(Exception):  # the node has ended meanwhile
                offered = self._node.get_service_names_and_types_by_node(node, namespace)
                acts = self._action_graph.get_action_server_names_and_types_by_node(self._node, node, namespace)
            for name, kinds in offered:
                if len(services) < MAX_SERVERS and kinds and kinds[0] in SERVICES:
                    services.setdefault(name, ServiceServer(name, kinds[0], full))
            for name, kinds in acts:
                if len(actions) < MAX_SERVERS and kinds and name not in actions:
                    actions[name] = ActionServer(name, kinds[0], full, self._action_fields(kinds[0]))
        return tuple(services.values()), tuple(actions.values())

    def _action_fields(self, kind: str) -> ActionFields | None:
        try:
            found = self.interface(kind)
        except RobotUnavailable:
            return None
        parts = (found.Goal, found.Result, found.Feedback)
        return ActionFields(*(dict(list(part.get_fields_and_field_types().items())[:MAX_FIELDS]) for part in parts))

    def listen(self, kind: Any, topic: str, callback: Callable[[Any], None], kept: bool = False) -> None:
        """Subscribe. `kept`: also to the messages that were published before."""
        profile = self._qos.QoSProfile(
            depth=DEPTH,
            reliability=self._qos.ReliabilityPolicy["RELIABLE" if kept else "BEST_EFFORT"],
            durability=self._qos.DurabilityPolicy["TRANSIENT_LOCAL" if kept else "VOLATILE"],
            history=self._qos.HistoryPolicy.KEEP_LAST,
        )
        self._node.create_subscription(kind, topic, callback, profile)

    def parameters(self, node: str, wanted: Sequence[str]) -> dict[str, ParameterValue]:
        """Return those of the wanted parameters that a node has; empty if it does not answer.

        A node in C++ answers nothing at all when one name is unknown to it, so its names are asked for first.
        """
        kinds = self._services
        listed = self._call(kinds.ListParameters, f"{node}/list_parameters", kinds.ListParameters.Request())
        if listed is None:
            return {}
        names = [name for name in wanted if name in set(listed.result.names)]
        request = kinds.GetParameters.Request(names=names)
        answer = self._call(kinds.GetParameters, f"{node}/get_parameters", request) if names else None
        if answer is None:
            return {}
        found: dict[str, ParameterValue] = {}
        for name, value in zip(names, answer.values, strict=False):
            if (field := _FIELDS.get(value.type)) is not None:
                held = getattr(value, field)
                found[name] = list(held) if value.type == 9 else held
        return found

    def _call(self, kind: Any, service: str, request: Any) -> Any | None:
        client = self._node.create_client(kind, service)
        try:
            if not client.wait_for_service(timeout_sec=SERVICE_SECONDS):
                return None
            future = client.call_async(request)
            end = time.monotonic() + SERVICE_SECONDS
            while not future.done() and time.monotonic() < end:
                time.sleep(0.01)  # the node's thread completes it
            return future.result() if future.done() else None
        finally:
            with suppress(Exception):
                self._node.destroy_client(client)


def _endpoints(infos: Sequence[Any]) -> tuple[Endpoint, ...]:
    return tuple(
        Endpoint(
            node=f"{info.node_namespace.rstrip('/')}/{info.node_name}",
            kind=str(info.topic_type),
            reliable=info.qos_profile.reliability.name == "RELIABLE",
            kept=info.qos_profile.durability.name == "TRANSIENT_LOCAL",
        )
        for info in infos
        if info.node_name not in (NODE, "_NODE_NAME_UNKNOWN_")
    )
