"""Runs goals of ROS 2 action servers, and cancels them until they have ended.

A goal goes on in its server until that ends it. So a cancelled goal is cancelled again and again, also when its server
accepts it only after the cancel, and a fault says so while it has not ended. A server that cannot be found has not
ended its goal: it may be behind a network that is down, and drives on. It is asked when it is found again. So is one
that was not found any more before it accepted the goal.
"""

import math
from collections.abc import Callable
from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible, ActionRun, ActionStep
from lockstep.robot_bridge.robots.ros2.actions.id_cancel import CANCEL_AGAIN, IdCancels
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.words import words_of

__all__ = ["GoalClient", "GoalRun", "Reading"]

SUCCEEDED, CANCELED = 4, 5  # action_msgs/GoalStatus
GONE = 1.0  # s without the server, after which its goal has failed
MOST_FORGOTTEN = 64  # cancelled goals that are followed at once, and those that no server knew


class Reading:
    """How the messages of an action are read. Its methods may raise; the goal then says nothing."""

    def progress(self, feedback: Any) -> tuple[float, str]:
        """Return the progress, from 0 to 1, and what the action does."""
        return 0.0, ""

    def result(self, result: Any) -> str:
        """Return the result in words."""
        return ""

    def succeeded(self, result: Any) -> bool:
        """Return whether a goal that the server calls reached or aborted is done."""
        return False


class GoalClient:
    """One action server. Call `tick` often: it cancels what has to end."""

    def __init__(self, ros: RosSide, type: str, action: str, timeout: float) -> None:
        """Make the client. `type`: "package/Name" or "package/action/Name".

        Raises:
            RobotUnavailable: the action is not installed.
        """
        package, _, name = type.partition("/")
        self.kind = ros.interface(f"{package}/action/{name.rpartition('/')[2]}")
        self.action = action
        self.full_name = ros.full_name(action)
        self.timeout = timeout
        self.cancels = IdCancels(ros, self.full_name)
        self._client = ros.action_client(self.kind, action)
        self._ending: list[GoalRun] = []  # cancelled, and not known to have ended
        self._unknown: list[GoalRun] = []  # cancelled, never accepted, and not known to the server when it was asked

    def begin(self, goal: Any, reading: Reading) -> "GoalRun":
        """Send a goal, once.

        Raises:
            ActionNotPossible: there is no server, or an earlier goal has not ended.
        """
        if not self._client.server_is_ready():
            raise ActionNotPossible(f"nobody offers the action {self.action}")
        if self._ending:
            raise ActionNotPossible(f"{self.action} has not ended the last goal yet")
        return GoalRun(self, self._client, goal, reading)

    def ending(self, run: "GoalRun") -> None:
        self._ending.append(run)
        del self._ending[:-MOST_FORGOTTEN]

    def tick(self, now: float) -> None:
        """Cancel again what was cancelled and has not ended."""
        late = [run for run in self._unknown if run.answered]
        if late:  # its server accepted it after all
            self._unknown = [run for run in self._unknown if run not in late]
            for run in late:
                run.leave_again(now)
        if self._ending:
            ended = [run for run in self._ending if run.ended_after_cancel(now)]
            self._ending = [run for run in self._ending if run not in ended]
            self._unknown += [run for run in ended if not run.answered]
            del self._unknown[:-MOST_FORGOTTEN]

    def faults(self, now: float) -> list[str]:
        """Return what a person has to know: the server goes on with a goal that was cancelled."""
        if any(run.overdue(now) for run in self._ending):
            return [f"{self.action}: the cancelled goal has not ended, the robot may still move"]
        return []

    @property
    def has_ending(self) -> bool:
        """True while a goal was cancelled and is not known to have ended."""
        return bool(self._ending)

    @property
    def has_unanswered(self) -> bool:
        """True while such a goal may still be accepted."""
        return any(not run.answered for run in self._ending)

    def is_there(self) -> bool:
        return bool(self._client.server_is_ready())


class GoalRun(ActionRun):
    """One goal, from sending until its result. Its futures and its feedback change on the node's thread."""

    def __init__(self, owner: GoalClient, client: Any, goal: Any, reading: Reading) -> None:
        self._owner = owner
        self._reading = reading
        self._deadline = clock.now() + owner.timeout
        self._seen_at = clock.now()  # when the server was there last
        self._feedback: Any = None  # the newest; written by the node's thread
        self._handle: Any = None  # of the accepted goal
        self._result: Any = None  # its future
        self._cancelled_at: float | None = None
        self._cancel_tried_at = -math.inf
        self._is_lost = False  # the server was not there at the last look after the cancel
        self._over = False  # its end was told
        id = owner.cancels.new_id()
        self._by_id = owner.cancels.of(id, owner.timeout)
        self._accepting = client.send_goal_async(goal, feedback_callback=self._take, goal_uuid=id)

    @property
    def over(self) -> bool:
        """True when it was cancelled, has failed or is done."""
        return self._cancelled_at is not None or self._over

    @property
    def answered(self) -> bool:
        """True when its server has accepted or refused it."""
        return bool(self._accepting.done())

    def _take(self, message: Any) -> None:
        self._feedback = message.feedback

    def step(self) -> ActionStep:
        now = clock.now()
        if self._owner.is_there():
            self._seen_at = now
        elif now - self._seen_at > GONE:
            self._leave(now)
            raise ActionFailed(f"nobody offers the action {self._owner.action} any more")
        try:
            is_accepted = self._accepted()
        except ActionFailed:
            self._over = True
            raise
        if not is_accepted:
            if now > self._deadline:
                self._leave(now)
                raise ActionFailed(f"{self._owner.action} did not accept the goal within {self._owner.timeout:g} s")
            return ActionStep(text="asked")
        if self._result.done():
            return self._outcome()
        progress, text = self._read(self._reading.progress, self._feedback, (0.0, ""))
        return ActionStep(progress=progress, text=text)

    def cancel(self) -> None:
        """Cancel the goal now. `GoalClient.tick` sees to it that it ends."""
        self._leave(clock.now())

    def _leave(self, now: float) -> None:
        if self._cancelled_at is None:
            self._cancelled_at = now
            self._owner.ending(self)
            self.ended_after_cancel(now)  # the owner looks again at its next tick

    def leave_again(self, now: float) -> None:
        """Cancel a goal that was accepted after it had been given up."""
        self._cancelled_at = None
        self._leave(now)

    def ended_after_cancel(self, now: float) -> bool:
        """Cancel the goal, again at intervals. True when there is nothing left to cancel."""
        try:
            if not self._accepted():
                return self._by_id.ended(now, self._owner.is_there())
        except ActionFailed:
            return True
        if self._result.done():
            return True
        was_lost, self._is_lost = self._is_lost, not self._owner.is_there()
        if self._is_lost:
            return False
        if was_lost:  # the result may have been lost too; a server that has been restarted answers that it knows none
            self._result = self._handle.get_result_async()
        if now - self._cancel_tried_at >= CANCEL_AGAIN:
            self._cancel_tried_at = now
            self._handle.cancel_goal_async()
        return False

    def overdue(self, now: float) -> bool:
        return self._cancelled_at is not None and now - self._cancelled_at > self._owner.timeout

    def _accepted(self) -> bool:
        """Return whether the server has accepted the goal.

        Raises:
            ActionFailed: it has refused it.
        """
        if self._handle is not None:
            return True
        if not self._accepting.done():
            return False
        try:
            handle = self._accepting.result()
        except Exception as error:  # an answer that cannot be read is no reason to end the bridge
            raise ActionFailed(f"{self._owner.action} gave no answer that can be read: {words_of(error)}") from error
        if handle is None or not handle.accepted:
            raise ActionFailed(f"{self._owner.action} refused the goal")
        self._handle, self._result = handle, handle.get_result_async()
        return True

    def _outcome(self) -> ActionStep:
        self._over = True
        try:
            answer = self._result.result()
        except Exception as error:
            raise ActionFailed(f"{self._owner.action} gave no result that can be read: {words_of(error)}") from error
        if answer is None:
            raise ActionFailed(f"{self._owner.action} gave no result")
        text = words_of(self._read(self._reading.result, answer.result, ""))
        if answer.status == SUCCEEDED or self._read(self._reading.succeeded, answer.result, False):
            return ActionStep(progress=1.0, text=text, done=True)
        what = "was cancelled by its server" if answer.status == CANCELED else "was aborted by its server"
        raise ActionFailed(f"{self._owner.action} {what}{': ' if text else ''}{text}")

    def _read(self, how: Callable[[Any], Any], message: Any, otherwise: Any) -> Any:
        if message is None:
            return otherwise
        try:
            return how(message)
        except Exception:  # a field that the settings name and the message does not have, or a value that is none
            return otherwise
