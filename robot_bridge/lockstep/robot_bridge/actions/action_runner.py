"""Runs the actions of a robot: takes requests from the link, calls the adapter, and tells how each action does."""

import logging
from collections.abc import Callable
from functools import partial

import msgspec

from lockstep.protocol.actions import Act, ActionCancel, ActionReason, ActionUpdate
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import encode_message
from lockstep.robot_bridge.actions.action_core import ActionCore, Begun, RobotNow
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible, ActionRun, ActionStep
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["ActionRunner"]

NOTED = 64  # ends of actions whose time is known; a newcomer is told fewer
KEYS = 32  # updates that may wait for a link that cannot take more; a further one takes the place of an older one

_logger = logging.getLogger(__name__)


class ActionRunner:
    """Owns the runs of actions. Call `look` and then `step` in every tick, before the axes are driven."""

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
        self._robot = robot
        self._events = events
        self._shaper = shaper
        self._counters = counters
        self._log = log
        self._now = now
        self._core = ActionCore(description.actions, hold=description.hold, max_event_age=description.max_event_age)
        self._runs: dict[str, ActionRun] = {}  # by id
        self._error: BaseException | None = None  # raised by the adapter outside of a tick; it ends the bridge
        self._drives = False  # the moving action drives the axes itself
        self._link: LinkTransport | None = None  # of the operator
        self._noted: dict[str, float] = {}  # id -> s, when the action ended; oldest first
        self._keys: dict[str, int] = {}  # id -> its key among the messages that wait

    @property
    def moving(self) -> bool:
        """True while an action moves the robot."""
        return bool(self._core.moving)

    # The link

    def link_opened(self, link: LinkTransport) -> None:
        """Tell a new operator link of the newest actions."""
        self._link = link
        now = self._now()
        for update in self._core.newest():
            self._send(msgspec.structs.replace(update, age=max(0.0, now - self._noted.get(update.id, now))))

    def link_lost(self) -> None:
        self._link = None
        self.interrupt("link_down")

    def act(self, link: LinkTransport, act: Act) -> None:
        """Take a request. It is answered on its link."""
        outcome = self._core.request(act, self._robot_now())
        if isinstance(outcome, Begun):
            self._begin(act.id, outcome)
            return
        if outcome.update.state == "refused":
            self._note(outcome.update)
        self._send(outcome.update)

    def _begin(self, id: str, begun: Begun) -> None:
        try:
            self._runs[id] = self._robot.begin_action(begun.action.name, begun.parameters)
        except ActionNotPossible as error:
            self._tell(self._core.finish(id, "refused", self._events.current, reason="not_possible", text=str(error)))
            return
        except BaseException as error:
            self._error = error
            self._tell(self._core.finish(id, "failed", self._events.current))
            return
        self._tell(begun.update)

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
        self._cancelled(self._core.look(self._robot_now()))

    def step(self) -> None:
        """Let every action go on for one tick.

        Raises:
            BaseException: the adapter raised.
        """
        for id, run in list(self._runs.items()):
            try:
                self._stepped(id, run.step())
            except ActionFailed as error:
                self._ended(id, self._core.finish(id, "failed", self._events.current, text=str(error)))

    def _stepped(self, id: str, step: ActionStep) -> None:
        if step.done:
            self._ended(id, self._core.finish(id, "done", self._events.current, text=step.text))
            return
        self._tell(self._core.progress(id, step.progress, step.text, self._robot_now()), final=False)
        if step.values is not None:
            if id != self._core.moving:
                raise ValueError("an action that is not declared to move drives axes")
            if (misfit := self._events.values.misfit(step.values)) is not None:
                raise ValueError(f"an action drives axes with values that do not fit them: {' '.join(misfit)}")
            self._shaper.drive(step.values, self._core.renewed_at)
            self._drives = True

    def _ended(self, id: str, update: ActionUpdate | None) -> None:
        self._runs.pop(id, None)
        if update is not None and update.moves:
            self._rest()
        self._tell(update)

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
        self._rest()
        for update in ended:
            self._note(update)

    def _cancelled(self, updates: list[ActionUpdate]) -> None:
        for update in updates:
            run = self._runs.pop(update.id, None)
            if update.moves:
                self._rest()
            if run is not None:
                try:
                    run.cancel()
                except BaseException as error:  # ends the bridge at the next tick, and not the link of a message
                    self._error = error
            self._tell(update)

    def _rest(self) -> None:
        """Bring the axes to rest if the action has driven them."""
        if self._drives:
            self._drives = False
            self._shaper.rest()

    def _robot_now(self) -> RobotNow:
        now, events = self._now(), self._events
        return RobotNow(
            now,
            events.current,
            events.stops.state,
            events.interlock.needed,
            events.interlock.warns(now) > 0,
            self._shaper.at_rest,
        )

    # Telling

    def _tell(self, update: ActionUpdate | None, *, final: bool = True) -> None:
        if update is None:
            return
        if final:
            self._note(update)
        self._send(update)

    def _note(self, update: ActionUpdate) -> None:
        if update.state != "running" and self._core.remembers(update.id):
            self._noted.setdefault(update.id, self._now())
            if len(self._noted) > NOTED:
                del self._noted[next(iter(self._noted))]
        self._counters.actions[update.state] += 1
        self._log.record(
            "action", update.event, id=update.id, name=update.name, state=update.state, reason=update.reason
        )

    def _send(self, update: ActionUpdate) -> None:
        """Send on the operator link. Updates of one action replace each other while the link cannot take more."""
        if self._link is None:
            return
        key = self._keys.setdefault(update.id, len(self._keys))
        if len(self._keys) > KEYS:
            key = self._keys[update.id] = self._keys.pop(next(iter(self._keys)))
        self._link.send_encoded(f"action {key}", partial(_encoded, update))


def _encoded(update: ActionUpdate) -> bytes:
    return frame(encode_message(update))
