"""Random lives of a robot with goal axes, its bridge and its network: the applied goals keep their rules in every tick.

The cores are put together as the bridge's shells do; `HangingArm` hangs below its goals, and falls while it is stopped.
"""

import math
from collections.abc import Sequence

import msgspec
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from lockstep.protocol.messages import Command, Feedback
from lockstep.protocol.neutral import neutral_values
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.control.event_core import EventCore, Executed
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.stop.stop_latch import ResetTaken
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, HangingArm

pytestmark = pytest.mark.slow

HOLD = 0.3
AGE = 2.0
DT = 0.004
ROUNDING = 1e-6
NEUTRAL = neutral_values(ARM_AXES)
SETS = ((1, 2), (4, 5))  # the joints, and the tool in their place
offsets = st.none() | st.floats(-0.7, 0.7) | st.just(0.0)


class GoalLife(RuleBasedStateMachine):
    """Clients answer any feedback ever seen; the network delays, duplicates and reorders; ticks come as they can."""

    @initialize(sag=st.floats(0, 0.2), settling=st.sampled_from([0.0, 0.05, 0.15]))
    def begin(self, sag: float, settling: float = 0.0) -> None:
        self.now = 1000.0
        self.robot = HangingArm(sag)
        self.settling = settling
        poses = [msgspec.structs.replace(pose, settling=settling) for pose in self.robot.describe().poses]
        self.core = EventCore(ARM_AXES, max_event_age=AGE, poses=poses, measured=self.robot.measured_axes)
        self.shaper = AxisShaper(ARM_AXES, hold=HOLD, poses=poses, pursued=self.robot.goals)
        self.shaper.begin(self.robot.measured_axes(), self.robot.measured_axes())
        self.applied: Sequence[float] = self.shaper.values
        self.robot.pursued = list(self.applied)
        self.rates = [0.0] * len(ARM_AXES)
        self.executed_at = -math.inf
        self.executed: list[int] = []
        self.sent: list[Command] = []
        self.seen: list[Feedback] = []
        self.issued_at: dict[tuple[int, int], float] = {}  # by issue and nonce of the feedback
        self.reads: set[int] = set()  # axes whose goals may be read anew in the next tick
        self.was_cut = False
        self.moved = 0  # commands that move, executed
        self.issue()
        self.arm()

    # the clients and the network

    @rule(
        back=st.integers(0, 3), which=st.sampled_from(SETS), one=offsets, other=offsets, turn=offsets,
        speed=st.floats(0, 1),
    )  # fmt: skip
    def a_client_sends_goals_from_where_it_saw_them(
        self,
        back: int,
        which: tuple[int, int],
        one: float | None,
        other: float | None,
        turn: float | None,
        speed: float,
    ) -> None:
        answered = self.seen[-1 - min(back, len(self.seen) - 1)]
        values = list(NEUTRAL)
        for number, offset in ((which[0], one), (which[1], other), (3, turn)):
            goal = answered.goals[number]
            values[number] = None if offset is None or goal is None else goal + offset
        self.send(answered, values, speed)

    @precondition(lambda self: not self.core.stops.state.stopped)
    @rule(
        which=st.sampled_from(SETS), to=st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.floats(-9, 9)),
        speed=st.floats(0.1, 1), times=st.integers(1, 20), gap=st.sampled_from([DT, 2 * DT, 0.05]),
    )  # fmt: skip
    def an_operator_drives_for_a_while(
        self, which: tuple[int, int], to: tuple[float, float, float], speed: float, times: int, gap: float
    ) -> None:
        self.arm()
        for _ in range(times):
            answered, values = self.seen[-1], list(NEUTRAL)
            for number, goal in zip((*which, 3), to, strict=True):
                place = answered.axes[number]
                values[number] = place + min(max(goal - place, -0.4), 0.4)
            self.send(answered, values, speed)
            self.tick(gap)

    @rule(back=st.integers(0, 3))
    def a_client_sends_a_neutral_command(self, back: int) -> None:
        self.send(self.seen[-1 - min(back, len(self.seen) - 1)], NEUTRAL, 1.0)

    @rule(base=st.floats(-2, 2))
    def a_client_drives_the_base(self, base: float) -> None:
        self.send(self.seen[-1], [base, *NEUTRAL[1:]], 1.0)

    def send(self, answered: Feedback, values: Sequence[float | None], speed: float) -> None:
        command = Command(
            event=event_after(answered.event),
            issue=answered.issue,
            nonce=answered.nonce,
            values=values,
            speed=speed,
        )
        self.sent.append(command)
        self.deliver(command)

    @precondition(lambda self: self.sent)
    @rule(data=st.data())
    def the_network_delivers_any_copy(self, data: st.DataObject) -> None:
        self.deliver(data.draw(st.sampled_from(self.sent[-8:])))

    def deliver(self, command: Command) -> None:
        was_needed = self.core.interlock.needed
        outcome = self.core.command(command, self.now)
        if not isinstance(outcome, Executed):
            return
        assert self.now - self.issued_at[command.issue, command.nonce] <= AGE, "it is late"
        assert not (was_needed and self.core.values.moves(outcome.values)), "it moves before a neutral command"
        assert outcome.event not in self.executed, "executed twice"
        self.executed.append(outcome.event)
        measured = self.robot.measured_axes()
        for axis, goal, place in zip(ARM_AXES, outcome.values, measured, strict=True):
            if goal is not None and axis.kind == "goal":
                way = goal - place
                way = math.remainder(way, axis.wrap) if axis.wrap else way
                assert abs(way) <= axis.reach + ROUNDING, "a jump executed"
        self.shaper.drive(outcome.values, self.now, outcome.speed)
        self.executed_at = self.now

        self.moved += self.core.values.moves(outcome.values)

    @rule()
    def arm(self) -> None:
        """The operator begins anew, after whatever was."""
        self.send(self.seen[-1], NEUTRAL, 1.0)
        self.tick(DT)

    # what brings it to rest

    @rule()
    def a_client_rests_or_its_link_breaks(self) -> None:
        if self.core.rest(event_after(self.core.current)):
            self.shaper.rest()

    @rule()
    def another_operator_comes(self) -> None:
        self.shaper.rest()
        self.core.interlock.require()

    @rule()
    def the_bridge_was_held_up(self) -> None:
        self.shaper.step(self.now, DT)
        self.shaper.take_back()
        assert self.shaper.values[1:] == self.applied[1:], "it moves in a tick that was not applied"
        self.shaper.cut()
        self.core.interlock.require()
        self.was_cut = True

    @rule()
    def somebody_stops(self) -> None:
        if self.core.stops.stop("", "someone", "", self.now).is_new:
            self.shaper.rest()

    @precondition(lambda self: self.core.stops.state.stopped and self.shaper.at_rest)
    @rule(fallen=st.floats(0, 1.5), holds=st.booleans())
    def the_arm_falls_while_it_is_stopped_and_the_stop_is_reset(self, fallen: float, holds: bool) -> None:
        self.now += 1.1
        self.tick(DT)
        self.robot.sag += fallen
        if isinstance(self.core.stops.reset(self.core.stops.state.number, self.now), ResetTaken):
            measured = self.robot.measured_axes()
            self.shaper.begin(measured, self.robot.goals() if holds else measured)
            for axis, goal, place in zip(ARM_AXES[1:], self.shaper.goals[1:], measured[1:], strict=True):
                assert goal is not None
                assert abs(goal - place) <= axis.reach
            self.applied = self.shaper.values  # the only place where the goals are measured anew
            self.robot.pursued = list(self.applied)
        self.robot.sag -= fallen

    # the ticks

    @rule(gaps=st.lists(st.floats(1e-6, 2 * DT) | st.just(DT), min_size=1, max_size=40))
    def ticks_pass(self, gaps: list[float]) -> None:
        for gap in gaps:
            self.tick(gap)

    @rule(gap=st.floats(0.01, 0.5) | st.floats(AGE / 2, 2 * AGE))
    def a_tick_comes_late(self, gap: float) -> None:
        self.tick(gap)

    def tick(self, gap: float) -> None:
        self.now += gap
        pursued, before = list(self.robot.pursued), list(self.applied)
        after = self.shaper.step(self.now, DT)
        late = self.now >= self.executed_at + HOLD
        for number, axis in enumerate(ARM_AXES):
            if axis.kind == "rate":
                assert not late or after[number] == 0.0, "a rate outlives hold"
                continue
            beginnings = [(before[number], self.rates[number])]
            if number in (*SETS[0], *SETS[1]):
                beginnings.append((pursued[number], 0.0))  # read where the other set has brought it
            steepest = max(axis.acceleration, axis.brake) * max(DT, gap)
            for began, rate in beginnings:
                self.rates[number] = (after[number] - began) / DT
                continuous = abs(self.rates[number] - rate) <= steepest + ROUNDING or self.was_cut
                if continuous and abs(self.rates[number]) <= axis.slew + ROUNDING:
                    break
            else:
                raise AssertionError(f"{axis.name} jumps or jerks")
            low, high = min(axis.minimum, began) - ROUNDING, max(axis.maximum, began) + ROUNDING
            assert axis.wrap or low <= after[number] <= high, "it left its limits"
            still_at = self.executed_at + HOLD - (self.settling if number in SETS[1] else 0.0)
            assert self.now < still_at or after[number] == before[number], f"{axis.name} moves after hold"
        self.was_cut = False
        self.applied = after
        self.robot.apply(after)
        for number in SETS[0]:
            moved = abs(self.robot.pursued[number] - pursued[number])
            assert moved <= ARM_AXES[number].slew * DT + ROUNDING, "a joint jumps"
        if self.core.issue_due(self.now):
            self.issue()

    def issue(self) -> None:
        measured = self.robot.measure()._replace(at_rest=self.shaper.at_rest)
        self.seen.append(self.core.issue(measured, self.now, goals=self.shaper.goals))
        self.issued_at[self.seen[-1].issue, self.seen[-1].nonce] = self.now


GoalLife.TestCase.settings = settings(max_examples=100, stateful_step_count=50, deadline=None)
TestGoalLife = GoalLife.TestCase


def test_a_loaded_arm_does_not_creep_down_over_a_thousand_engagements() -> None:
    life = GoalLife()
    life.begin(sag=0.15)
    began = life.shaper.goals
    for _ in range(1000):
        held = list(NEUTRAL)
        held[1:4] = life.seen[-1].goals[1:4]
        life.send(life.seen[-1], held, 1.0)
        life.tick(DT)
        life.a_client_rests_or_its_link_breaks()
        life.another_operator_comes()
        life.tick(DT)
        life.arm()
    assert life.moved == 1000
    assert life.shaper.goals[:4] == began[:4]
    assert life.robot.measured_axes()[1] == pytest.approx(life.applied[1] - 0.15)
