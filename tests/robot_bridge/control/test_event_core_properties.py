"""Random lives of a bridge and its network: the invariants hold after every step."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from lockstep.protocol.messages import Command, Feedback
from lockstep.protocol.serial import MAX_EVENT, event_after, event_gap
from lockstep.robot_bridge.control.event_core import Answered, EventCore, Executed
from tests.robot_bridge.control.core_helpers import AXES, MAX_AGE, MEASURED, NEUTRAL, reason

pytestmark = pytest.mark.slow

values = st.sampled_from([[0.5, 0.2], [-1.0, 0.3], NEUTRAL])


class BridgeLife(RuleBasedStateMachine):
    """Clients answer any feedback ever seen; the network delays, duplicates and reorders without bound."""

    @initialize(first=st.sampled_from([1, 77, MAX_EVENT - 2, MAX_EVENT]))
    def begin(self, first: int) -> None:
        self.now = 1000.0
        self.core = EventCore(AXES, max_event_age=MAX_AGE, first_event=first)
        self.seen: list[Feedback] = [self.core.issue(MEASURED, self.now)]
        self.sent: list[Command] = []
        self.executed: list[int] = []
        self.void_up_to: int | None = None
        self.last_current = self.core.current

    @rule(seconds=st.sampled_from([0.0, 0.004, 0.1, 0.5, 1.9, 2.1, 10.0]))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds

    @rule(back=st.integers(0, 5), moves=values)
    def a_client_answers_a_feedback(self, back: int, moves: list[float]) -> None:
        answered = self.seen[-1 - min(back, len(self.seen) - 1)]
        event, issue = event_after(answered.event), answered.issue
        self.sent.append(Command(event=event, issue=issue, values=moves, nonce=answered.nonce))

    @rule(event=st.integers(1, MAX_EVENT), issue=st.integers(1, 20), moves=values)
    def a_client_makes_something_up(self, event: int, issue: int, moves: list[float]) -> None:
        self.sent.append(Command(event=event, issue=issue, values=moves))

    @precondition(lambda self: self.sent)
    @rule(data=st.data())
    def the_network_delivers_any_copy(self, data: st.DataObject) -> None:
        self.deliver(data.draw(st.sampled_from(self.sent[-12:])))

    def deliver(self, command: Command) -> None:
        stopped, pending, current = self.core.stops.state.stopped, self.core.pending, self.core.current
        outcome = self.core.command(command, self.now)
        if isinstance(outcome, Answered):
            assert outcome.feedback.event == command.event == current
        if not isinstance(outcome, Executed):
            return
        assert not stopped, "executed while stopped"
        assert pending is None, "executed while another event was pending"
        assert outcome.event == event_after(current), "executed out of order"
        assert outcome.event not in self.executed, "executed twice"
        answered = [f for f in self.seen if (event_after(f.event), f.issue) == (command.event, command.issue)]
        assert answered, "executed without a feedback to answer"
        assert self.now - answered[-1].time <= MAX_AGE, "executed late"
        if command.values != NEUTRAL and self.void_up_to is not None:
            assert event_gap(command.event, self.void_up_to) > 0, "executed although rested"
        self.executed.append(outcome.event)
        self.void_up_to = None

    @rule(delay=st.sampled_from([0.0, 0.004]))
    def a_tick_ends(self, delay: float) -> None:
        self.now += delay
        if self.core.issue_due(self.now):
            self.seen.append(self.core.issue(MEASURED, self.now))

    @rule(ahead=st.integers(-2, 1))
    def a_client_rests(self, ahead: int) -> None:
        event = (self.core.current + ahead) % 2**31
        if event == 0 or not self.core.rest(event):
            return
        if self.void_up_to is None or event_gap(event, self.void_up_to) > 0:
            self.void_up_to = event

    @rule()
    def somebody_stops(self) -> None:
        self.core.stops.stop("", "someone", "", self.now)

    @rule()
    def somebody_resets(self) -> None:
        self.core.stops.reset(self.core.stops.state.number, self.now)

    @rule(copies=st.integers(2, 4), moves=values)
    def the_network_freezes_a_command_and_its_copies(self, copies: int, moves: list[float]) -> None:
        newest = self.seen[-1]
        frozen = Command(event=event_after(newest.event), issue=newest.issue, values=moves, nonce=newest.nonce)
        self.now += 10.0
        for _ in range(copies):
            assert reason(self.core.command(frozen, self.now)) not in ("executed",), "a frozen copy executed"
            self.a_tick_ends(0.004)

    @invariant()
    def the_reference_never_decreases_and_counts_each_execution_once(self) -> None:
        assert event_gap(self.core.current, self.last_current) in (0, 1, 2)
        self.last_current = self.core.current
        answered = [event for event in self.executed if event != self.core.pending]
        expected = answered[-1] if answered else self.seen[0].event
        assert self.core.current == expected


BridgeLife.TestCase.settings = settings(max_examples=150, stateful_step_count=60, deadline=None)
TestBridgeLife = BridgeLife.TestCase
