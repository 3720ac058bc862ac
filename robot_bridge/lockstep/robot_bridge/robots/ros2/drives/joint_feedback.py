"""Reads the joints of an arm from sensor_msgs/JointState."""

from collections.abc import Sequence
from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.drives.joint_cache import BadJointState, JointCache, JointKnown
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide, header_ns
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.settings import JointStates

__all__ = ["JointFeedback"]


class JointFeedback:
    """The newest state of each joint. Messages come in the node's thread; the bridge's loop reads."""

    def __init__(self, ros: RosSide, settings: JointStates, names: Sequence[str]) -> None:
        self._timeout, self._still = settings.timeout, settings.still
        self._book = JointCache(names)
        self._states: Newest[None] = Newest(settings.topic, settings.timeout)
        ros.subscribe(ros.interface("sensor_msgs/msg/JointState"), settings.topic, self._take)

    def is_complete(self, now: float) -> bool:
        """Return whether the state of every joint is fresh."""
        return not self._book.missing(self._timeout, now)

    def known(self, now: float) -> list[JointKnown]:
        """Return the state of every joint; NaN for a joint whose state is too old."""
        return self._book.fresh(self._timeout, now)

    def is_still(self, known: Sequence[JointKnown]) -> bool:
        """Return whether no joint moves; False if one is not known."""
        return all(abs(joint.velocity) <= self._still for joint in known)

    def faults(self, now: float) -> list[str]:
        found = self._states.faults(now)
        missing = self._book.missing(self._timeout, now)
        if missing and not found:
            found.append(f"{self._states.topic}: no positions of {', '.join(missing[:8])}")
        return found

    def _take(self, message: Any) -> None:
        now = clock.now()
        try:
            self._book.take(message, header_ns(message.header), now)
            self._states.put(None, now)
        except BadJointState as error:
            self._states.refuse(str(error), now)
        except (TypeError, ValueError, OverflowError) as error:
            self._states.refuse(f"joint states: {type(error).__name__}", now)
