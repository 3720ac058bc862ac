"""Runs the actions of a robot: takes requests from the link, calls the adapter, and tells how each action does."""

import logging
from collections.abc import Callable

from lockstep.protocol.actions import Act, ActionCancel, ActionReason, ActionUpdate
from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.actions.action_axes import ActionAxes
from lockstep.robot_bridge.actions.action_core import ActionCore, Begun, RobotNow
from lockstep.robot_bridge.actions.action_reports import ActionReports
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible, ActionRun, ActionStep
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["ActionRunner"]

_logger = logging.getLogger(__name__)


class ActionRunner:
    """Owns the runs of actions. Call `look` and then `step` in every tick, before the axes are driven.

    Attributes:
        waits: the action that moves the robot waited to be renewed in the last step
    """

    def __init__(
        self,
        robot: Robot,
        description: RobotDescription,
        events: EventCore,
        shaper: AxisShaper,
        counters: BridgeCounters,
        log: EventLog,
        now: Callable[[], float],
    ) -> None:
        self.waits = False
        self._robot = robot
        self._events = events
        self._shaper = shaper
        self._now = now
        self._core = ActionCore(description.actions, hold=description.hold, max_event_age=description.max_event_age)
        self._axes = ActionAxes(shaper, events.values)
        self._reports = ActionReports(self._core.outcomes, counters, log, now)
        self._runs: dict[str, ActionRun] = {}  # by id
        self._error: BaseException | None = None  # raised by the adapter outside of a tick; it ends the bridge

    @property
    def moving(self) -> bool:
        """True while an action moves the robot."""
        return bool(self._core.moving)

    # The link

    def link_opened(self, link: LinkTransport) -> None:
        """Tell a new operator link of the newest actions."""
        self._reports.link_opened(link)

    def link_lost(self) -> None:
        self._reports.link_lost()
        self.interrupt("link_down")

    def act(self, act: Act) -> None:
        """Take a request of the operator link, and answer it."""
        outcome = self._core.request(act, robot_now(self._events, self._shaper, self._now()))
        if not isinstance(outcome, Begun):
            self._reports.tell(outcome.update, is_new=outcome.update.state == "refused")
            return
        try:
            run = self._runs[act.id] = self._robot.begin_action(outcome.action.name, outcome.parameters)
        except ActionNotPossible as error:
            why = str(error)
            self._reports.tell(
                self._core.finish(act.id, "refused", self._events.current, reason="not_possible", text=why)
            )
        except BaseException as error:
            self._error = error
            self._reports.tell(self._core.finish(act.id, "failed", self._events.current))
        else:
            if act.id == self._core.moving and run.waits:
                self._core.renewal.let_wait()
            self._reports.tell(outcome.update)

    def cancel(self, message: ActionCancel) -> None:
        self._cancelled(self._core.cancel(message.id, self._events.current))

    def commanded(self, action: str, *, moving: bool, executed: bool, now: float) -> None:
        """Note a command of the operator: an intention to move cancels; a neutral one that names the action renews."""
        if moving:
            self.interrupt("driving")
        elif executed:
            self._core.renewed(action, now)

    def interrupt(self, reason: ActionReason) -> None:
        """Cancel the action that moves the robot."""
        self._cancelled(self._core.interrupt(reason, self._events.current))

    def issued(self, nonce: int, now: float) -> None:
        """Note a feedback that requests may answer."""
        self._core.issued(nonce, now)

    # The tick

    def look(self) -> None:
        """Cancel the moving action if it must not go on.

        Raises:
            BaseException: the adapter's, if it raised since the last tick.
        """
        if self._error is not None:
            raise self._error
        self._cancelled(self._core.look(robot_now(self._events, self._shaper, self._now())))

    def step(self) -> None:
        """Let every action go on for one tick, but one that waits to be renewed.

        Raises:
            BaseException: the adapter raised.
        """
        self.waits = self.moving and self._core.renewal.waits(self._now())
        for id, run in list(self._runs.items()):
            if self.waits and id == self._core.moving:
                continue
            try:
                self._stepped(id, run.step())
            except ActionFailed as error:
                self._ended(id, self._core.finish(id, "failed", self._events.current, text=str(error)))

    def _stepped(self, id: str, step: ActionStep) -> None:
        if step.done:
            self._ended(id, self._core.finish(id, "done", self._events.current, text=step.text))
            return
        robot = robot_now(self._events, self._shaper, self._now())
        self._reports.tell(self._core.progress(id, step.progress, step.text, robot), is_new=False)
        if step.values is not None:
            if id != self._core.moving:
                raise ValueError("an action that is not declared to move drives axes")
            self._axes.drive(step.values, self._core.renewal.at)

    def _ended(self, id: str, update: ActionUpdate | None) -> None:
        self._runs.pop(id, None)
        if update is not None and update.moves:
            self._axes.rest()
        self._reports.tell(update)

    def close(self) -> None:
        """Cancel all actions, because the ticks end. Raises nothing."""
        ended = self._core.interrupt("interrupted", self._events.current)
        for id in list(self._runs):
            run = self._runs.pop(id)
            update = self._core.finish(id, "cancelled", self._events.current, reason="interrupted")
            ended += [] if update is None else [update]
            try:
                run.cancel()
            except BaseException as error:  # nothing may keep the robot from resting
                _logger.error("cancelling an action raised %r", error)
        self._axes.rest()
        for update in ended:
            self._reports.note(update)

    def _cancelled(self, updates: list[ActionUpdate]) -> None:
        for update in updates:
            run = self._runs.pop(update.id, None)
            if update.moves:
                self._axes.rest()
            if run is not None:
                try:
                    run.cancel()
                except BaseException as error:  # ends the bridge at the next tick, and not the link of a message
                    self._error = error
            self._reports.tell(update)


def robot_now(events: EventCore, shaper: AxisShaper, now: float) -> RobotNow:
    """Return the state that a request is judged by."""
    return RobotNow(
        now,
        events.current,
        events.stops.state,
        events.interlock.needed,
        warns=events.interlock.warns(now) > 0,
        at_rest=shaper.at_rest,
    )
