"""Counts the events of a session in the metrics."""

from functools import cached_property

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
    LinkDown,
    LinkUp,
    Refused,
    ResetDone,
    RestForwarded,
    SeatChanged,
    SessionEvents,
    SpeedCapChanged,
    StatusReceived,
    StopAsked,
)
from lockstep.server.telemetry.metrics import Metrics

__all__ = ["SessionMetrics"]


class SessionMetrics:
    """A subscriber to the events of a session."""

    def __init__(self, metrics: Metrics) -> None:
        self._metrics = metrics
        self._holder = ""  # of the seat, a peer id

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(CommandForwarded, self._command_forwarded)
        events.subscribe(CommandRefused, self._command_refused)
        events.subscribe(CommandRepeated, self._command_repeated)
        events.subscribe(RestForwarded, self._rest_forwarded)
        events.subscribe(FeedbackReceived, self._feedback_received)
        events.subscribe(Refused, self._refused)
        events.subscribe(InputRefused, self._input_refused)
        events.subscribe(SpeedCapChanged, self._speed_cap_changed)
        events.subscribe(ActionUpdated, self._action_updated)
        events.subscribe(ActionRefused, self._action_refused)
        events.subscribe(StatusReceived, self._status_received)
        events.subscribe(EpochBegan, self._epoch_began)
        events.subscribe(LinkUp, self._link_up)
        events.subscribe(LinkDown, self._link_down)
        events.subscribe(StopAsked, self._stop_asked)
        events.subscribe(ResetDone, self._reset_done)
        events.subscribe(SeatChanged, self._seat_changed)
        events.subscribe(AuditTrouble, self._audit_trouble)

    @cached_property
    def _forwarded(self) -> Counter:
        """The commonest of them, kept: finding a label takes longer than counting."""
        return self._metrics.commands.labels("forward")

    def _command_forwarded(self, event: CommandForwarded) -> None:
        self._forwarded.inc()

    def _command_refused(self, event: CommandRefused) -> None:
        self._metrics.commands.labels("refuse").inc()

    def _command_repeated(self, event: CommandRepeated) -> None:
        self._metrics.commands.labels("answer" if event.answered else "absorbed").inc()

    def _rest_forwarded(self, event: RestForwarded) -> None:
        if event.why:
            self._metrics.rests.labels(event.why).inc()

    def _feedback_received(self, event: FeedbackReceived) -> None:
        feedback = event.feedback
        if event.turnaround is not None:
            self._metrics.robot_turnaround.observe(event.turnaround)
        self._metrics.feedback.inc()
        self._metrics.event.set(feedback.event)
        self._metrics.stopped.set(feedback.stop.stopped)
        self._metrics.limits_acted(feedback.limits)

    def _refused(self, event: Refused) -> None:
        self._metrics.refusals.labels(event.refusal.reason).inc()

    def _input_refused(self, event: InputRefused) -> None:
        self._metrics.bad_input.labels(event.channel, event.error).inc()

    def _speed_cap_changed(self, event: SpeedCapChanged) -> None:
        self._metrics.speed_share.set(event.state.share)

    def _action_updated(self, event: ActionUpdated) -> None:
        if event.new_state:
            self._metrics.actions.labels(event.update.state, event.update.reason).inc()

    def _action_refused(self, event: ActionRefused) -> None:
        self._metrics.actions.labels("refused", event.update.reason).inc()

    def _status_received(self, event: StatusReceived) -> None:
        self._metrics.status_shown(event.status)

    def _epoch_began(self, event: EpochBegan) -> None:
        self._metrics.status_shown(Status(event=1))  # the last one was another bridge's

    def _link_up(self, event: LinkUp) -> None:
        self._metrics.link_up.set(1)

    def _link_down(self, event: LinkDown) -> None:
        self._metrics.link_up.set(0)
        if event.was_up:
            self._metrics.link_losses.inc()

    def _stop_asked(self, event: StopAsked) -> None:
        self._metrics.stops.labels(event.where).inc()

    def _reset_done(self, event: ResetDone) -> None:
        self._metrics.resets.inc()

    def _seat_changed(self, event: SeatChanged) -> None:
        if event.seat.holder != self._holder:
            self._holder = event.seat.holder
            self._metrics.seat_changes.labels(event.seat.kind).inc()

    def _audit_trouble(self, event: AuditTrouble) -> None:
        self._metrics.audit_failing.set(bool(event.trouble))
