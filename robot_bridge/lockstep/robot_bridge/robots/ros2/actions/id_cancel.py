"""Cancels goals by their id alone: their server has not said whether it accepted them.

The answer may be lost although the server accepted the goal, and it may come late. A server that does not know the goal
now may accept it later, so it has to say so for a while.
"""

import math
import uuid
from typing import Any

from lockstep.robot_bridge.robots.ros2.ros_side import RosSide

__all__ = ["CANCEL_AGAIN", "IdCancel", "IdCancels"]

CANCEL_AGAIN = 0.2  # s between two tries to cancel
ANSWER_SECONDS = 5.0  # without an answer, after which a request counts as lost
UNKNOWN_GOAL, TERMINATED = 2, 3  # action_msgs/srv/CancelGoal: ERROR_UNKNOWN_GOAL_ID, ERROR_GOAL_TERMINATED


class IdCancels:
    """Makes ids for the goals of one server, and cancels by them."""

    def __init__(self, ros: RosSide, server: str) -> None:
        """`server`: the full name of the action.

        Raises:
            RobotUnavailable: action_msgs is not installed.
        """
        self._id = ros.interface("unique_identifier_msgs/msg/UUID")
        self._kind = ros.interface("action_msgs/srv/CancelGoal")
        self._client = ros.client(self._kind, f"{server}/_action/cancel_goal")

    def new_id(self) -> Any:
        """Return a unique_identifier_msgs/UUID."""
        return self._id(uuid=list(uuid.uuid4().bytes))

    def of(self, id: Any, patience: float) -> "IdCancel":
        """`patience`: s for which the server has to answer that it does not know the goal."""
        request = self._kind.Request()
        request.goal_info.goal_id = id
        return IdCancel(self._client, request, patience)


class IdCancel:
    """One goal. Call `ended` often."""

    def __init__(self, client: Any, request: Any, patience: float) -> None:
        self._client = client
        self._request = request
        self._patience = patience
        self._asked: Any = None  # the future of the request that is under way
        self._asked_at = -math.inf
        self._unknown_since: float | None = None  # s, since when each answer was that there is no such goal

    def ended(self, now: float, is_there: bool) -> bool:
        """Cancel again at intervals. True when the server says that the goal has ended, or never began.

        `is_there`: the server is found now. One that is not found may be behind a network that is down.
        """
        if not is_there:
            self._drop()
            self._unknown_since = None
            return False
        if self._asked is not None and self._asked.done():
            code = self._code()
            self._asked = None
            if code == TERMINATED:
                return True
            if code != UNKNOWN_GOAL:
                self._unknown_since = None
            elif self._unknown_since is None:
                self._unknown_since = now
        if now - self._asked_at >= (CANCEL_AGAIN if self._asked is None else ANSWER_SECONDS):
            self._drop()
            self._asked, self._asked_at = self._client.call_async(self._request), now
        return self._unknown_since is not None and now - self._unknown_since > self._patience

    def _code(self) -> int | None:
        try:
            return int(self._asked.result().return_code)
        except Exception:  # an answer that cannot be read says nothing
            return None

    def _drop(self) -> None:
        if self._asked is not None:
            self._client.remove_pending_request(self._asked)
            self._asked = None
