"""Counts the events of a session in the metrics."""

from functools import cached_property
from typing import assert_never, get_args

from prometheus_client import Counter

from lockstep.protocol.actions import Status
from lockstep.server.audit.records import AuditTrouble
from lockstep.server.session_events import (
    ActionRefused,
    ActionUpdated,
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    EpochBegan,
    FeedbackReceived,
    InputRefused,
    Refused,
    ResetDone,
    RestForwarded,
    RobotLinkDown,
    RobotLinkUp,
    SeatChanged,
    SessionEvents,
    SpeedCapChanged,
    StatusReceived,
    StopAsked,
)
from lockstep.server.telemetry.metrics import Metrics

__all__ = ["SessionMetrics"]

Counted = (
    CommandRefused
    | CommandRepeated
    | RestForwarded
    | Refused
    | InputRefused
    | SpeedCapChanged
    | ActionUpdated
    | ActionRefused
    | StatusReceived
    | EpochBegan
    | RobotLinkUp
    | RobotLinkDown
    | StopAsked
    | ResetDone
    | SeatChanged
    | AuditTrouble
)


class SessionMetrics:
    """A subscriber to the events of a session."""

    def __init__(self, metrics: Metrics) -> None:
        self._metrics = metrics
        self._holder = ""  # of the seat, a peer id

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(CommandForwarded, self._command_forwarded)
        events.subscribe(FeedbackReceived, self._feedback_received)
        for kind in get_args(Counted):
            events.subscribe(kind, self._count)

    @cached_property
    def _forwarded(self) -> Counter:
        """The commonest of them, kept: finding a label takes longer than counting."""
        return self._metrics.commands.labels("forward")

    def _command_forwarded(self, event: CommandForwarded) -> None:
        self._forwarded.inc()

    def _feedback_received(self, event: FeedbackReceived) -> None:
        feedback = event.feedback
        if event.turnaround is not None:
            self._metrics.robot_turnaround.observe(event.turnaround)
        self._metrics.feedback.inc()
        self._metrics.event.set(feedback.event)
        self._metrics.stopped.set(feedback.stop.stopped)
        self._metrics.limits_acted(feedback.limits)

    def _count(self, event: Counted) -> None:
        metrics = self._metrics
        match event:
            case CommandRefused():
                metrics.commands.labels("refuse").inc()
            case CommandRepeated():
                metrics.commands.labels("answer" if event.answered else "absorbed").inc()
            case RestForwarded():
                if event.why:
                    metrics.rests.labels(event.why).inc()
            case Refused():
                metrics.refusals.labels(event.refusal.reason).inc()
            case InputRefused():
                metrics.bad_input.labels(event.channel, event.error).inc()
            case SpeedCapChanged():
                metrics.speed_share.set(event.state.share)
            case ActionUpdated():
                if event.new_state:
                    metrics.actions.labels(event.update.state, event.update.reason).inc()
            case ActionRefused():
                metrics.actions.labels("refused", event.update.reason).inc()
            case StatusReceived():
                metrics.status_shown(event.status)
            case EpochBegan():
                metrics.status_shown(Status(event=1))  # the last one was another bridge's
            case RobotLinkUp():
                metrics.robot_link_up.set(1)
            case RobotLinkDown():
                metrics.robot_link_up.set(0)
                if event.was_up:
                    metrics.link_losses.inc()
            case StopAsked():
                metrics.stops.labels(event.where).inc()
            case ResetDone():
                metrics.resets.inc()
            case SeatChanged():
                if event.seat.holder != self._holder:
                    self._holder = event.seat.holder
                    metrics.seat_changes.labels(event.seat.kind).inc()
            case AuditTrouble():
                metrics.audit_failing.set(bool(event.trouble))
            case _:
                assert_never(event)
