"""Hands on clutches, a network and a lagging arm: what the arm is told goes on without a jump, and ends within `hold`.

The client's sender and clutches, the bridge's event core and shaping, and the inverse kinematics are the real ones; the
sockets and the clock are not. The network delays, loses, doubles and reorders; hands let go and take hold again at any
moment; the tool, or two mirrored joints in its place, are driven; the robot is stopped and reset, taken over by
somebody else, and held up.
"""

import math
from typing import Final

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from lockstep.client.control.clutch import Clutch
from lockstep.client.control.clutches import Clutches
from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.control.event_core import Answered, EventCore, Executed, Refused
from lockstep.robot_bridge.robots.base import Measurement
from lockstep.robot_bridge.robots.so101.controls import RATES
from lockstep.robot_bridge.stop.stop_latch import ResetTaken
from tests.robot_bridge.robots.so101.arm_world import AXES, HOLD, POSE, SLOW, TICK, World

DESCRIPTION = RobotDescription(name="arm", label="Arm", axes=AXES, poses=(POSE,), hold=HOLD)
NEUTRAL: Final[list[float | None]] = [None] * len(AXES)
AGE: Final = 2.0  # s
SLACK: Final = 1e-6  # rad
HANDS: Final = (
    dict.fromkeys((*POSE.position, *POSE.rotation), 1.0),
    {"shoulder_pan": 1.0, "elbow_flex": -1.0},
)
SIZES: Final = (6, 2)
pytestmark = pytest.mark.slow
ways = st.floats(-0.02, 0.02)  # of a hand in a tick


class ClutchedTool(RuleBasedStateMachine):
    @initialize(pace=st.sampled_from([1.0, SLOW]))
    def begin(self, pace: float) -> None:
        self.world = World(pace)
        self.rates = [pace * rate for rate in RATES[:5]]
        self.core = EventCore(AXES, max_event_age=AGE, poses=(POSE,), measured=self.world.drive.pursued)
        self.sender = CommandSender(CommandGate("feedback", 4, 0.0), NEUTRAL)
        self.clutches = Clutches(self.sender, AGE)
        self.hands = [Clutch(DESCRIPTION, scales) for scales in HANDS]
        for clutch in self.hands:
            self.clutches.add(clutch, 0.0)
        self.devices = [[3.0] * size for size in SIZES]
        self.hand: int | None = None  # that holds
        self.led: int | None = None  # by the hand that held last, and by nobody else since
        self.kept_still: tuple[float, ...] | None = None  # joints' goals while a hand that engaged has not moved yet
        self.delay, self.losses = 0.0, [False]
        self.up: list[tuple[float, Command | Rest]] = []
        self.down: list[tuple[float, Feedback | Refusal]] = []
        self.moved_until = -math.inf  # s, by which the last good event's motion has ended
        self.executed: set[int] = set()
        self.sender.seat_changed(True)
        self.issue()
        self.arm_and_wait()

    # The operator

    @rule()
    def arm_and_wait(self) -> None:
        self.sender.arm()
        self.ticks_pass(10)

    @rule(
        hand=st.sampled_from([0, 1]), way=st.lists(ways, min_size=6, max_size=6), times=st.integers(1, 3),
        gap=st.integers(0, 40), rests=st.booleans(),
    )  # fmt: skip
    def drive_and_take_hold_again_and_again(
        self, hand: int, way: list[float], times: int, gap: int, rests: bool
    ) -> None:
        if not self.sender.readiness.ready:
            self.arm_and_wait()
        for number in range(times):
            self.take_hold(hand, float(number), rests)
            self.ticks_pass(gap)
            self.the_hand_moves(way, 30)
            self.let_go(rests)
            self.ticks_pass(gap)

    @rule(hand=st.sampled_from([0, 1]), device=st.floats(-3, 3), rests=st.booleans())
    def take_hold(self, hand: int, device: float, rests: bool) -> None:
        """Anywhere: it engages as soon as it can. Another hand lets go, with a rest."""
        self.let_go(rests or hand != self.led)
        self.hand = self.led = hand
        self.devices[hand] = [device] * SIZES[hand]

    @rule(rests=st.booleans())
    def let_go(self, rests: bool) -> None:
        """With a rest, as `lockstep drive` and the page do: it voids what is under way. Or without."""
        self.hand = self.kept_still = None
        for clutch in self.hands:
            clutch.release()
        if rests:
            self.sender.rest(self.world.now)
        elif self.sender.readiness.ready and not self.sender.resting:
            self.sender.intend(NEUTRAL, self.world.now)

    @rule(way=st.lists(ways, min_size=6, max_size=6), ticks=st.integers(1, 60))
    def the_hand_moves(self, way: list[float], ticks: int) -> None:
        hand = self.hand
        if hand is None:
            self.ticks_pass(ticks)
            return
        for _ in range(ticks):
            self.kept_still = None
            self.devices[hand] = [place + step for place, step in zip(self.devices[hand], way, strict=False)]
            self.tick(TICK)

    def operate(self) -> None:
        """What a program does in each of its turns. It has waited for the end of its rest, as `Console.rest` does."""
        if self.hand is None or not self.sender.readiness.ready or self.sender.resting:
            return
        clutch, device = self.hands[self.hand], self.devices[self.hand]
        if not clutch.engaged:
            self.kept_still = self.world.drive.goals if clutch.engage(device) else None
        found = clutch.values(device)
        self.sender.intend([found.get(axis.name) for axis in AXES], self.world.now)

    # The network

    @rule(delay=st.sampled_from([0.0, 0.03, 0.1, 0.2]), losses=st.lists(st.booleans(), min_size=1, max_size=6))
    def the_network_changes(self, delay: float, losses: list[bool]) -> None:
        """What is under way keeps its time: later messages may overtake it."""
        self.delay, self.losses = delay, [*losses, False]

    def is_lost(self) -> bool:
        self.losses.append(self.losses.pop(0))
        return self.losses[-1]

    @precondition(lambda self: self.up)
    @rule(data=st.data())
    def a_message_comes_twice(self, data: st.DataObject) -> None:
        _, message = data.draw(st.sampled_from(self.up))
        self.up.append((self.world.now + data.draw(st.floats(0.0, 0.4)), message))

    # The robot

    @rule()
    def somebody_stops_and_resets(self) -> None:
        if self.core.stops.stop("", "someone", "", self.world.now).is_new:
            self.world.shaper.rest()
        self.must_end(0.0)
        self.ticks_pass(round((HOLD + 1.2) / TICK))
        assert self.world.shaper.at_rest
        stood = self.world.drive.goals
        assert isinstance(self.core.stops.reset(self.core.stops.state.number, self.world.now), ResetTaken)
        self.world.shaper.begin(self.world.drive.pursued(), self.world.drive.pursued())
        self.world.drive.restart()
        self.ticks_pass(3)
        assert self.world.drive.goals == stood, "a reset moves something"

    @rule(way=st.floats(-0.3, 0.3), ticks=st.integers(1, 30))
    def another_operator_takes_over_and_moves_the_arm(self, way: float, ticks: int) -> None:
        self.sender.seat_changed(False)
        self.clutches.settle()
        self.hand = self.led = self.kept_still = None
        self.up.clear()
        self.world.shaper.rest()
        self.core.interlock.require()
        self.issue()
        for pan in (None, self.world.drive.goals[0] + way):
            newest = self.core.feedback
            assert newest is not None
            values = [pan, *NEUTRAL[1:]]
            event = event_after(newest.event)
            self.execute(Command(event=event, issue=newest.issue, nonce=newest.nonce, values=values))
            self.ticks_pass(ticks)
        self.world.shaper.rest()
        self.core.interlock.require()
        self.sender.seat_changed(True)
        self.issue()

    @rule(since=st.floats(0.1, 0.6))
    def the_bridge_is_held_up(self, since: float) -> None:
        self.core.interlock.require()
        self.tick(since, held_up=True)

    @rule(ticks=st.integers(1, 120))
    def ticks_pass(self, ticks: int) -> None:
        for _ in range(ticks):
            self.tick(TICK)

    def tick(self, since: float, *, held_up: bool = False) -> None:
        self.operate()
        self.pass_on()
        world = self.world
        before, late = world.drive.goals, world.now + since - TICK >= self.moved_until
        world.tick(since, held_up=held_up)
        after = world.drive.goals
        for place, goal, rate in zip(before, after, self.rates, strict=True):
            assert abs(goal - place) <= rate * TICK + SLACK, "a joint jumps"
        assert after == before or not (late or held_up), "a joint moves after `hold`"
        if self.kept_still is not None:
            for goal, stood in zip(after, self.kept_still, strict=True):
                assert abs(goal - stood) <= 1e-4, "engaging moves the arm"
        if world.shaper.take_settled():
            self.core.want_issue()
        if self.core.issue_due(world.now):
            self.issue()

    def issue(self) -> None:
        shaper, places = self.world.shaper, self.world.drive.pursued()
        measured = Measurement(places, joints=[], wrench=[], ranges=[], at_rest=shaper.at_rest, faults=[])
        self.send_down(self.core.issue(measured, self.world.now, goals=shaper.goals))

    def send_down(self, message: Feedback | Refusal) -> None:
        if not self.is_lost():
            self.down.append((self.world.now + self.delay, message))

    def pass_on(self) -> None:
        now = self.world.now
        for message in self.sender.due(now):
            self.clutches.sent(message)
            if not self.is_lost():
                self.up.append((now + self.delay, message))
        self.clutches.settle()
        self.sender.outcomes()
        arrived = [message for time, message in self.up if time <= now]
        self.up = [each for each in self.up if each[0] > now]
        for message in arrived:
            self.execute(message)
        heard = [message for time, message in self.down if time <= now]
        self.down = [each for each in self.down if each[0] > now]
        for answer in heard:
            self.hear(answer)

    def hear(self, answer: Feedback | Refusal) -> None:
        if isinstance(answer, Refusal):
            self.sender.refusal(answer)
        elif self.sender.feedback(answer, self.world.now):
            self.clutches.feedback(answer, self.world.now)
        self.clutches.settle()
        if not any(clutch.engaged for clutch in self.hands):
            self.kept_still = None

    def execute(self, message: Command | Rest) -> None:
        if isinstance(message, Rest):
            if self.core.rest(message.event):
                self.world.shaper.rest()
                self.must_end(0.0)
            return
        outcome = self.core.command(message, self.world.now)
        if isinstance(outcome, Executed):
            assert outcome.event not in self.executed, "executed twice"
            self.executed.add(outcome.event)
            self.world.command(outcome.values, outcome.speed)
            self.moved_until = self.world.now + HOLD
        elif isinstance(outcome, Answered):
            self.send_down(outcome.feedback)
        elif isinstance(outcome, Refused):
            self.send_down(outcome.refusal)

    def must_end(self, seconds: float) -> None:
        """Nothing executes any more: motion ends within `hold` of now at the latest."""
        self.moved_until = min(self.moved_until, self.world.now + HOLD + seconds)


TestClutchedTool = ClutchedTool.TestCase
TestClutchedTool.settings = settings(max_examples=30, stateful_step_count=20, deadline=None)
