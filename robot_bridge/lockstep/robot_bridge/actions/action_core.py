"""Decides which actions begin and when they have to end. No I/O, no clock: the caller hands in `now`.

Call order: `issued` with each feedback; `request`, `renewed`, `cancel` and `interrupt` in any order; `look` once a
tick, before the robot moves. Each of them returns the updates to tell. An update that is `cancelled` also means that
the run of this action has to be cancelled now. Rules and reasons: docs/robot-link.md, "Actions".
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from lockstep.protocol.actions import Act, ActionReason, ActionState, ActionUpdate, ParameterValue
from lockstep.protocol.description import Action
from lockstep.protocol.messages import StopState
from lockstep.robot_bridge.actions.parameters import parameters_of
from lockstep.robot_bridge.actions.recent_feedback import RecentFeedback
from lockstep.robot_bridge.actions.renewal import Renewal
from lockstep.robot_bridge.actions.request_outcomes import RequestOutcomes
from lockstep.robot_bridge.errors import BadParameter

__all__ = ["ActionCore", "Begun", "RobotNow", "Told"]

MAX_RUNNING = 8
PROGRESS_INTERVAL = 0.2  # s between two updates of progress alone
SAME_EVERY_TIME = ("unknown_action", "bad_parameter", "late")  # a repeat gets these again without being remembered


class RobotNow(NamedTuple):
    """The state that a request is judged by."""

    now: float  # s
    event: int  # the current one
    stop: StopState
    neutral_needed: bool
    warns: bool  # the robot warns before it moves
    at_rest: bool  # no axis is driven


class Begun(NamedTuple):
    """The action begins now: the caller makes the robot begin it."""

    action: Action
    parameters: dict[str, ParameterValue]
    update: ActionUpdate


class Told(NamedTuple):
    """Nothing begins; tell the update: a refusal, or the state of an earlier request with this id."""

    update: ActionUpdate


class ActionCore:
    """Each id begins at most once. At most one action that moves the robot runs, and only while it is renewed.

    Attributes:
        outcomes: what became of each request
        renewal: of the action that moves the robot
    """

    def __init__(self, actions: Sequence[Action], *, hold: float, max_event_age: float) -> None:
        self._actions = {action.name: action for action in actions}
        self.renewal = Renewal(hold)
        self.outcomes = RequestOutcomes(max_event_age)
        self._feedback = RecentFeedback(max_event_age)
        self._running: dict[str, float] = {}  # ids that run -> s, when their progress was told last
        self._moving = ""

    @property
    def moving(self) -> str:
        """The id of the action that moves the robot; "" if none does."""
        return self._moving

    def issued(self, nonce: int, now: float) -> None:
        """Note a feedback: for `max_event_age` requests may answer it."""
        self._feedback.issued(nonce, now)

    def request(self, act: Act, robot: RobotNow) -> Begun | Told:
        """Decide about a request that arrived now."""
        if act.id in self.outcomes:
            return Told(self.outcomes[act.id])
        action = self._actions.get(act.name)
        if action is None:
            return self._refuse(act, robot, "unknown_action")
        try:
            parameters = parameters_of(action, act.parameters)
        except BadParameter as error:
            return self._refuse(act, robot, "bad_parameter", error.detail)
        if not self.outcomes.make_room(robot.now):
            # Without this, a later copy of a refused request could begin: its id is not remembered.
            self._feedback.forget()
            return self._refuse(act, robot, "too_often")
        if (reason := self._why_not(act, action, robot)) is not None:
            return self._refuse(act, robot, reason, robot.stop.reason if reason == "stopped" else "")
        update = ActionUpdate(
            id=act.id,
            name=act.name,
            state="running",
            moves=action.moves,
            event=robot.event,
            began=robot.event,
            by=act.by,
        )
        self.outcomes.add(update, robot.now)
        self._running[act.id] = robot.now
        if action.moves:
            self._moving = act.id
            self.renewal.begin(robot.now)
        return Begun(action, parameters, update)

    def _why_not(self, act: Act, action: Action, robot: RobotNow) -> ActionReason | None:
        if robot.stop.locked_out:
            return "locked_out"
        if robot.stop.stopped:
            return "stopped"
        if action.moves and robot.neutral_needed:
            return "not_neutral"
        if not self._feedback.is_answered_in_time(act.nonce, robot.now, moves=action.moves):
            return "late"
        if len(self._running) >= MAX_RUNNING or any(self.outcomes[id].name == act.name for id in self._running):
            return "busy"
        if action.moves and self._moving:
            return "busy"
        if action.moves and robot.warns:
            return "warning"
        return "driving" if action.moves and not robot.at_rest else None

    def renewed(self, id: str, now: float) -> bool:
        """Note that a neutral command executed which names this action. True if it lets that action go on."""
        return id != "" and id == self._moving and self.renewal.renew(now)

    def look(self, robot: RobotNow) -> list[ActionUpdate]:
        """Cancel the moving action if it must not go on."""
        if robot.stop.locked_out:
            return self.interrupt("locked_out", robot.event)
        if robot.stop.stopped:
            return self.interrupt("stopped", robot.event)
        if robot.neutral_needed:
            return self.interrupt("interrupted", robot.event)
        if self._moving and self.renewal.is_over(robot.now):
            return self.interrupt("not_renewed", robot.event)
        return []

    def interrupt(self, reason: ActionReason, event: int) -> list[ActionUpdate]:
        """Cancel the moving action, and void requests for a motion that were decided before."""
        self._feedback.void()
        return self._end([self._moving] if self._moving else [], "cancelled", reason, event)

    def cancel(self, id: str, event: int) -> list[ActionUpdate]:
        """Cancel the action with this id, or the moving one for ""."""
        if not id or id == self._moving:
            return self.interrupt("cancelled", event)
        return self._end([id] if id in self._running else [], "cancelled", "cancelled", event)

    def progress(self, id: str, progress: float, text: str, robot: RobotNow) -> ActionUpdate | None:
        """Note how far a running action is. Return the update if it is time to tell it."""
        if id not in self._running:
            return None
        before = self.outcomes[id]
        progress = min(max(progress, 0.0), 1.0) if math.isfinite(progress) else before.progress
        if (progress, text) == (before.progress, before.text):
            return None
        if text == before.text and robot.now - self._running[id] < PROGRESS_INTERVAL:
            return None
        self._running[id] = robot.now
        update = msgspec.structs.replace(before, progress=progress, text=text[:500], event=robot.event)
        self.outcomes.replace(update)
        return update

    def finish(
        self, id: str, state: ActionState, event: int, *, reason: ActionReason = "", text: str = ""
    ) -> ActionUpdate | None:
        """End a running action. None if it does not run any more."""
        ended = self._end([id] if id in self._running else [], state, reason, event, text)
        return ended[0] if ended else None

    def _end(
        self, ids: Sequence[str], state: ActionState, reason: ActionReason, event: int, text: str = ""
    ) -> list[ActionUpdate]:
        ended = []
        for id in ids:
            before = self.outcomes[id]
            progress = 1.0 if state == "done" else before.progress
            update = msgspec.structs.replace(
                before, state=state, reason=reason, progress=progress, text=(text or before.text)[:500], event=event
            )
            self.outcomes.replace(update)
            del self._running[id]
            if id == self._moving:
                self._moving = ""
            ended.append(update)
        return ended

    def _refuse(self, act: Act, robot: RobotNow, reason: ActionReason, text: str = "") -> Told:
        action = self._actions.get(act.name)
        update = ActionUpdate(
            id=act.id,
            name=act.name,
            state="refused",
            reason=reason,
            text=text[:500],
            moves=action is not None and action.moves,
            event=robot.event,
            by=act.by,
        )
        if reason not in SAME_EVERY_TIME and reason != "too_often":
            self.outcomes.add(update, robot.now)
        return Told(update)
