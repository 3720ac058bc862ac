"""Random lives of actions: requests, copies of them, commands, losses, stops, other holders of the seat, and time."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.description import Action
from lockstep.protocol.messages import StopState
from lockstep.robot_bridge.actions.action_core import ActionCore, Begun, RobotNow

pytestmark = pytest.mark.slow

HOLD, AGE = 0.3, 2.0
ACTIONS = (Action(name="home", label=""), Action(name="dock", label=""), Action(name="light", label="", moves=False))


class ActionLife(RuleBasedStateMachine):
    """Clients ask, the network repeats and delays without bound, and everything that has to end an action happens."""

    @initialize()
    def begin(self) -> None:
        self.now = 1000.0
        self.core = ActionCore(ACTIONS, hold=HOLD, max_event_age=AGE)
        self.stop = StopState()
        self.neutral_needed = False
        self.at_rest = True
        self.nonces: list[tuple[int, float]] = []  # with the time of issue
        self.voided_at = -1.0  # when something last ended every motion
        self.sent: list[Act] = []
        self.begun: list[str] = []
        self.moving: dict[str, float] = {}  # what moves the robot -> when it was renewed last
        self.a_feedback()

    def robot(self) -> RobotNow:
        return RobotNow(self.now, 1, self.stop, self.neutral_needed, False, self.at_rest)

    def ended(self, updates: list[ActionUpdate]) -> None:
        for update in updates:
            assert update.state != "running"
            self.moving.pop(update.id, None)

    @rule(seconds=st.sampled_from([0.0, 0.004, 0.1, 0.29, 0.3, 1.0, 2.1]))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds
        self.tick()

    @rule()
    def a_feedback(self) -> None:
        self.nonces.append((len(self.nonces) + 1, self.now))
        self.core.issued(*self.nonces[-1])

    @rule(name=st.sampled_from(["home", "dock", "light", "fly"]), back=st.integers(0, 3))
    def somebody_asks(self, name: str, back: int) -> None:
        nonce, _ = self.nonces[-1 - min(back, len(self.nonces) - 1)]
        self.sent.append(Act(id=f"id{len(self.sent)}", name=name, nonce=nonce))

    @precondition(lambda self: self.sent)
    @rule(data=st.data())
    def the_network_delivers_any_copy(self, data: st.DataObject) -> None:
        act = data.draw(st.sampled_from(self.sent[-8:]))
        outcome = self.core.request(act, self.robot())
        if not isinstance(outcome, Begun):
            return
        assert act.id not in self.begun, "begun twice"
        assert not self.stop.stopped, "begun while stopped or locked"
        issued = next(when for nonce, when in self.nonces if nonce == act.nonce)
        assert self.now - issued <= AGE, "begun late"
        self.begun.append(act.id)
        if outcome.action.moves:
            assert not self.moving, "two actions move the robot"
            assert not self.neutral_needed, "begun before a neutral command"
            assert self.at_rest, "begun while a stick drives"
            assert issued >= self.voided_at, "begun although it was voided"
            self.moving[act.id] = self.now

    @rule(data=st.data())
    def an_armed_event_names_an_action(self, data: st.DataObject) -> None:
        if self.stop.stopped:
            return
        id = data.draw(st.sampled_from([*self.begun[-3:], ""]))
        if self.core.renewed(id, self.now):
            self.moving[id] = self.now

    @rule(reason=st.sampled_from(["driving", "rested", "link_down", "interrupted"]))
    def a_stick_a_rest_a_lost_link_or_another_holder(self, reason: str) -> None:
        self.ended(self.core.interrupt(reason, 1))  # type: ignore[arg-type]
        assert self.core.moving == ""
        self.voided_at = self.now

    @rule(at_rest=st.booleans())
    def the_axes_are_driven_or_rest(self, at_rest: bool) -> None:
        self.at_rest = at_rest

    @rule(locked=st.booleans())
    def a_stop(self, locked: bool) -> None:
        self.stop = StopState(stopped=True, locked_out="key" if locked else "")
        self.neutral_needed = True

    @rule()
    def a_reset(self) -> None:
        self.stop = StopState()
        self.tick()

    @precondition(lambda self: not self.stop.stopped)
    @rule()
    def the_operator_arms(self) -> None:
        self.tick()
        self.neutral_needed = False

    @rule(data=st.data())
    def somebody_cancels(self, data: st.DataObject) -> None:
        self.ended(self.core.cancel(data.draw(st.sampled_from([*self.begun[-3:], ""])), 1))

    @precondition(lambda self: self.begun)
    @rule(data=st.data(), state=st.sampled_from(["done", "failed"]))
    def the_robot_ends_one(self, data: st.DataObject, state: str) -> None:
        update = self.core.finish(data.draw(st.sampled_from(self.begun[-3:])), state, 1)  # type: ignore[arg-type]
        self.ended([] if update is None else [update])

    @rule()
    def tick(self) -> None:
        self.ended(self.core.look(self.robot()))
        if self.stop.stopped or self.neutral_needed:
            self.voided_at = self.now
            assert not self.moving, "moves although it is stopped or asks for a neutral command"
        for renewed_at in self.moving.values():
            assert self.now - renewed_at < HOLD, "outlives hold"

    @invariant()
    def the_core_knows_what_moves(self) -> None:
        assert list(self.moving) == ([self.core.moving] if self.core.moving else [])


TestActionLife = ActionLife.TestCase
TestActionLife.settings = settings(max_examples=200, stateful_step_count=60, deadline=None)
