"""An action server that accepts a goal when it is told to, and that nobody finds meanwhile if it is told so.

It is made of the services and topics that an action is made of: a server of rclpy cannot leave the graph and go on. A
network that is down for a while makes any server look like that.
"""

import threading
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from example_interfaces.action import Fibonacci
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import qos_profile_action_status_default

UNKNOWN_GOAL = 2  # action_msgs/srv/CancelGoal
LONGEST = 60.0  # s, for a test that never lets it answer


class LateAction:
    """`hide` and `show`: whether clients find it. `accept`: answer the goals that wait."""

    def __init__(self, node: Any, name: str, note: Callable[..., None]) -> None:
        self._node, self._name, self._note = node, name, note
        self._accepting, self._ended = threading.Event(), threading.Event()
        self._goals: set[bytes] = set()  # accepted, and going on
        kinds, group = Fibonacci.Impl, ReentrantCallbackGroup()
        for kind, leaf, answer in (
            (kinds.SendGoalService, "send_goal", self._goal),
            (kinds.CancelGoalService, "cancel_goal", self._cancel),
            (kinds.GetResultService, "get_result", self._result),
        ):
            node.create_service(kind, f"{name}/_action/{leaf}", answer, callback_group=group)
        node.create_publisher(kinds.FeedbackMessage, f"{name}/_action/feedback", 10)
        self._status: Any = None
        self.show()

    def show(self) -> None:
        topic = f"{self._name}/_action/status"
        self._status = self._node.create_publisher(
            Fibonacci.Impl.GoalStatusMessage, topic, qos_profile_action_status_default
        )

    def hide(self) -> None:
        """A client looks for every part of a server; without this one it finds none."""
        self._node.destroy_publisher(self._status)

    def accept(self) -> None:
        self._accepting.set()

    def _goal(self, request: Any, response: Any) -> Any:
        self._note("late_asked")
        self._accepting.wait(LONGEST)
        self._goals.add(bytes(request.goal_id.uuid))
        self._note("late_accepted")
        response.accepted = True
        return response

    def _cancel(self, request: Any, response: Any) -> Any:
        id = bytes(request.goal_info.goal_id.uuid)
        if id in self._goals:
            self._note("late_cancelled")
            response.goals_canceling = [request.goal_info]
            self._ended.set()
        else:
            response.return_code = UNKNOWN_GOAL
            self._note("late_unknown")
        return response

    def _result(self, request: Any, response: Any) -> Any:
        self._ended.wait(LONGEST)
        response.status = GoalStatus.STATUS_CANCELED
        return response
