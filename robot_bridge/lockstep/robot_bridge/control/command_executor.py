"""Executes commands: takes the messages of the links, and moves the robot at each tick."""

import logging
from collections.abc import Callable, Sequence

from lockstep.protocol.actions import Act, ActionCancel, Status, StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Feedback, Reset, Rest, Stop
from lockstep.robot_bridge.actions.action_runner import ActionRunner
from lockstep.robot_bridge.actions.status_issuer import StatusIssuer
from lockstep.robot_bridge.control.clock import Clock
from lockstep.robot_bridge.control.event_core import Answered, EventCore, Executed, Refused
from lockstep.robot_bridge.control.feedback_issuer import FeedbackIssuer
from lockstep.robot_bridge.control.goals.measured_axes import MeasuredAxes
from lockstep.robot_bridge.control.goals.taken_up_goals import TakenUpGoals
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.motion_limits import MotionLimits
from lockstep.robot_bridge.control.start_signal import StartSignal
from lockstep.robot_bridge.control.ticks.tick_alarm import TickAlarm
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.link_server import LinkPeer
from lockstep.robot_bridge.link.link_session import BadInput
from lockstep.robot_bridge.link.refusals import Refusals
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.stop.stop_handler import StopHandler
from lockstep.robot_bridge.watchdog.watchdogs import Held, Watchdogs

__all__ = ["CommandExecutor"]

_logger = logging.getLogger(__name__)


class CommandExecutor:
    """The `LinkHandler` of the bridge, and one `tick` of the robot. Commands change what the next tick applies."""

    def __init__(
        self,
        robot: Robot,
        description: RobotDescription,
        core: EventCore,
        shaper: AxisShaper,
        limits: MotionLimits,
        watchdogs: Watchdogs,
        stops: StopHandler,
        feedback: FeedbackIssuer,
        actions: ActionRunner,
        measured: MeasuredAxes,
        refusals: Refusals,
        alarm: TickAlarm,
        counters: BridgeCounters,
        log: EventLog,
        now: Clock,
        own_status: Callable[[], Sequence[StatusItem]] = tuple,
    ) -> None:
        """`own_status`: the bridge's own items of the status."""
        self._robot = robot
        self._alarm = alarm
        self._core = core
        self._shaper = shaper
        self._limits = limits
        self._watchdogs = watchdogs
        self._stops = stops
        self._feedback = feedback
        self._actions = actions
        self._measured = measured
        self._taken_up = TakenUpGoals(robot, shaper)
        self._refusals = refusals
        self._counters = counters
        self._log = log
        self._now = now
        self._status = StatusIssuer(robot, own_status)
        self._signal = StartSignal(description)
        self._axes = len(description.axes)
        self._blind: frozenset[str] = frozenset()  # limits that slowed the robot because its position was unknown
        self._rested = True  # nothing was driven at the last tick

    # LinkHandler

    def link_opened(self, peer: LinkPeer) -> None:
        if peer.session.role == "operator":
            self._need_neutral()
            self._actions.link_opened(peer)
            self._status.want_issue()
        self._core.want_issue()

    def link_message(self, peer: LinkPeer, message: Command | Rest | Stop | Reset | Act | ActionCancel) -> None:
        match message:
            case Command():
                self._command(peer, message)
            case Rest():
                applied = self._core.rest(message.event)
                if applied:
                    self._shaper.rest()
                    self._alarm.ring()
                    self._actions.interrupt("rested")
                self._log.record("rest", message.event, applied=applied)
            case Stop():
                self._stops.stop(peer, message)
                self._alarm.ring()
            case Reset():
                self._stops.reset(peer, message)
            case Act():
                moved = self._actions.moving
                self._actions.act(message)
                if self._actions.moving and not moved:  # the bridge may be killed before the next tick tells it
                    self._watchdogs.ticked(self._now(), moving=True)
            case ActionCancel():
                self._actions.cancel(message)

    def link_bad_input(self, peer: LinkPeer, bad: BadInput) -> None:
        if bad.name == "malformed" or bad.name == "not_allowed":
            self._refusals.send(peer, self._core.refusal(bad.event, bad.name, bad.detail))

    def operator_lost(self) -> None:
        self._shaper.rest()
        self._actions.link_lost()

    def _command(self, peer: LinkPeer, command: Command) -> None:
        now = self._now()
        outcome = self._core.command(command, now)
        if isinstance(outcome, Executed | Refused):
            moving = len(command.values) == self._axes and self._core.values.moves(command.values)
            executed = isinstance(outcome, Executed)
            self._actions.commanded(command.action, moving=moving, executed=executed, now=now)
        if isinstance(outcome, Executed):
            self._feedback.rested_why = ""
            if not self._actions.moving:  # else the action has the axes, and this command is neutral
                self._shaper.drive(outcome.values, now, outcome.speed)
            self._alarm.ring()
            self._feedback.timing.executed(now)
            self._counters.executed += 1
            self._log.record("executed", outcome.event, issue=command.issue, values=outcome.values)
        elif isinstance(outcome, Answered):
            peer.send(outcome.feedback)
        elif isinstance(outcome, Refused):
            self._refusals.send(peer, outcome.refusal)

    def _need_neutral(self) -> None:
        """Bring the axes to rest; they move on only after a neutral command."""
        self._shaper.rest()
        self._core.interlock.require()

    # The tick

    def tick(self, now: float) -> Feedback | None:
        """Move the robot for one tick. Return a feedback if one is due.

        Raises:
            BaseException: the adapter raised.
        """
        self._stops.look(now)
        self._measured.look()
        self._actions.look()
        if self._taken_up.look():
            self._core.want_issue()
        moved = self._moves
        self._actions.step()
        values = self._shaper.step(now, self._robot.tick_seconds)  # asks for positions, which may hang too
        if (held := self._watchdogs.begin(now, moved)) is not None:
            self._held_up(held, moved)
            values = self._shaper.values
        self._watchdogs.ticked(now, self._moves)
        if self._places_known():
            self._robot.pursue_poses(self._shaper.pursued_poses)
            self._robot.apply(self._signal.on(values) if self._core.interlock.warns(now) else values)
        self._robot.tick()
        if self._feedback.timing.waits_for_tick:
            self._feedback.timing.applied(now, self._now())
        self._feedback.limits_act(self._limits.acting)
        self._note_blind(self._limits.blind)
        if self._shaper.at_rest:
            self._stops.rests()
        if self._shaper.take_settled():  # so that the next hand engages where the pose is, and not where it was to be
            self._core.want_issue()
        self.note_motion()
        if not self._core.issue_due(now):
            return None
        feedback = self._feedback.issue(acts=self._actions.moving and not self._actions.waits)
        self._actions.issued(feedback.nonce, now)
        return feedback

    def _places_known(self) -> bool:
        """Return whether every goal axis has a goal. Until then nothing is driven, and then a neutral command is due.

        Raises:
            BaseException: the adapter raised.
        """
        if self._shaper.is_known:
            return True
        known = self._shaper.begin(self._robot.measured_axes(), self._robot.goals())
        self._shaper.cut()
        self._feedback.rested_why = "" if known else "not driven: the place of a goal axis is not known"
        if known:
            self._core.interlock.require()
        return False

    @property
    def _moves(self) -> bool:
        return self._actions.moving or not self._shaper.at_rest

    def status(self, now: float) -> Status | None:
        """Return the robot's status if it is due.

        Raises:
            BaseException: the adapter raised.
        """
        return self._status.look(now, self._core.current)

    def end_actions(self) -> None:
        """Cancel all actions, because the ticks end. Raises nothing."""
        self._actions.close()

    def note_motion(self) -> None:
        """Record whether the robot is driven, if that has changed."""
        if self._moves == self._rested:
            self._rested = not self._moves
            self._log.record("at_rest" if self._rested else "driven", self._core.current)

    def _held_up(self, held: Held, moved: bool) -> None:
        """Make the operator begin anew after too long without a tick: the robot's motion meanwhile is unknown."""
        self._actions.interrupt("interrupted")
        self._shaper.take_back()  # the values of this tick were shaped before it was known
        self._shaper.cut()
        if moved and self._robot.rests_from_thread and not held.acted:  # a suspend holds up the thread too
            self._robot.rest_from_thread()
        self._core.interlock.require()
        self._counters.stalls += 1
        self._counters.watchdog += held.acted
        why = self._feedback.rested_why = f"came to rest: the bridge was held up for {held.seconds:.2f} s"
        _logger.error("%s%s", why, "; a watchdog brought the robot to rest meanwhile" if held.acted else "")
        self._log.record("stall", self._core.current, seconds=held.seconds, watchdog=held.acted)

    def _note_blind(self, blind: frozenset[str]) -> None:
        """Bring the axes to rest if a position is unknown.

        A deadman that is held until the position is known again must not start the robot.
        """
        begun, self._blind = blind - self._blind, blind
        if begun:
            self._need_neutral()
            self._feedback.rested_why = f"came to rest: the position is unknown ({', '.join(sorted(begun))})"
