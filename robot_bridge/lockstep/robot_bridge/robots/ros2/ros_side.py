"""The only module that uses rclpy: one node in a separate context, with its callbacks in a separate thread."""

import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any

from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.ros2.settings import Ros2Settings

__all__ = ["RosSide", "header_ns"]

JOIN_SECONDS = 2.0
FLUSH_SECONDS = 0.3  # for the last commands to be acknowledged before the node goes

_logger = logging.getLogger(__name__)


class RosSide:
    """A ROS 2 node. It publishes from any thread; callbacks of subscriptions run in its own thread and must not raise.

    Attributes:
        failure: the exception that ended the node's thread; None while it runs
    """

    def __init__(self, settings: Ros2Settings) -> None:
        """Make the node.

        Raises:
            RobotUnavailable: rclpy or a middleware is missing, or ROS cannot be initialised.
        """
        try:
            rclpy = import_module("rclpy")
            executors = import_module("rclpy.executors")
            self._qos, self._duration = import_module("rclpy.qos"), import_module("rclpy.duration")
            parameter = import_module("rclpy.parameter").Parameter
        except ImportError as error:
            raise RobotUnavailable(
                f"ROS 2 is missing ({error}): source the setup file of your installation, or install the extra ros2"
            ) from error
        self.failure: Exception | None = None
        self._closed = False
        self._publishers: list[Any] = []
        self._action_clients: list[Any] = []
        self._rclpy = rclpy
        self._context = rclpy.Context()
        try:
            self._context.init(args=[], domain_id=settings.domain)
            self._node = rclpy.create_node(
                settings.node,
                context=self._context,
                namespace=settings.namespace or None,
                use_global_arguments=False,
                enable_rosout=False,
                start_parameter_services=False,
                parameter_overrides=[parameter("use_sim_time", value=settings.use_sim_time)],
            )
        except Exception as error:
            with suppress(Exception):
                self._context.shutdown()
            raise RobotUnavailable(f"ROS 2 does not start: {error}") from error
        self._executor = executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)

    def start(self) -> None:
        """Start the callbacks, after all subscriptions were made."""
        self._thread.start()

    def interface(self, name: str) -> Any:
        """Import and return the class of a message, a service or an action, "std_msgs/msg/Bool".

        Raises:
            RobotUnavailable: it is not installed.
        """
        package, _, kind = name.rpartition("/")
        try:
            return getattr(import_module(package.replace("/", ".")), kind)
        except (ImportError, AttributeError) as error:
            raise RobotUnavailable(f"the ROS 2 interface {name} is missing: {error}") from error

    def publisher(self, kind: Any, topic: str) -> Any:
        """Return a publisher for commands: reliable, the newest only, nothing for subscribers that come later."""
        publisher = self._node.create_publisher(kind, topic, self._profile("RELIABLE"))
        self._publishers.append(publisher)
        return publisher

    def subscribe(
        self, kind: Any, topic: str, callback: Callable[[Any], None], *, depth: int = 1, kept: bool = False
    ) -> None:
        """Subscribe to a sensor: the newest message only, from reliable and best-effort publishers alike.

        `depth`: more, for a topic on which several nodes publish different things at once. `kept`: its publishers keep
        their newest message for subscribers that come later.
        """
        profile = self._profile("RELIABLE", depth, "TRANSIENT_LOCAL") if kept else self._profile("BEST_EFFORT", depth)
        self._node.create_subscription(kind, topic, callback, profile)

    def action_client(self, kind: Any, name: str) -> Any:
        """Return a client of an action, whose answers come on the node's thread. Make it before `start`."""
        client = import_module("rclpy.action").ActionClient(self._node, kind, name)
        self._action_clients.append(client)
        return client

    def full_name(self, name: str) -> str:
        """Return the full name of a topic, a service or an action."""
        return str(self._node.resolve_service_name(name))

    def client(self, kind: Any, service: str) -> Any:
        """Return a client, whose `call_async` answers on the node's thread. Make it before `start`."""
        return self._node.create_client(kind, service)

    def now_ns(self) -> int:
        """Return the time of the ROS clock, which header stamps are made with."""
        return int(self._node.get_clock().now().nanoseconds)

    def now_message(self) -> Any:
        """Return the same time as builtin_interfaces/Time."""
        return self._node.get_clock().now().to_msg()

    def span_message(self, seconds: float) -> Any:
        """Return a duration as builtin_interfaces/Duration."""
        return self._duration.Duration(seconds=seconds).to_msg()

    def flush(self) -> None:
        """Wait shortly until the subscribers have the published message."""
        for publisher in self._publishers:
            with suppress(Exception):
                publisher.wait_for_all_acked(self._duration.Duration(seconds=FLUSH_SECONDS))

    def close(self) -> None:
        """End the node; blocks shortly. May be called again."""
        if self._closed:
            return
        self._closed = True
        self.flush()
        self._executor.shutdown(timeout_sec=JOIN_SECONDS)
        if self._thread.is_alive():
            self._thread.join(JOIN_SECONDS)
        for client in self._action_clients:
            with suppress(Exception):
                client.destroy()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _profile(self, reliability: str, depth: int = 1, durability: str = "VOLATILE") -> Any:
        return self._qos.QoSProfile(
            depth=depth,
            reliability=self._qos.ReliabilityPolicy[reliability],
            durability=self._qos.DurabilityPolicy[durability],
            history=self._qos.HistoryPolicy.KEEP_LAST,
        )

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except Exception as error:
            if not self._closed:
                _logger.error("the ROS node ended: %s", error, exc_info=error)
                self.failure = error


def header_ns(header: Any) -> int:
    """Return the stamp of a std_msgs/Header in ns; 0 if it is unset."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
