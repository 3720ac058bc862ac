"""Clutch, sender and arbiter against a model of a robot: engaging moves nothing, whatever happened before."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from lockstep.client.control.clutch import Clutch
from lockstep.client.control.clutches import Clutches
from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest, StopState
from lockstep.protocol.neutral import neutral_values
from lockstep.protocol.serial import event_after
from lockstep.server.control.command_arbiter import Answer, CommandArbiter, Forward, ForwardRest, Refuse
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.event_clock import EventClock

pytestmark = pytest.mark.slow

ARM = RobotDescription(
    name="arm",
    label="Arm",
    axes=(
        Axis(name="base", label="Base", unit="m/s", minimum=-1, maximum=1, slew=1, brake=4),
        Axis(name="j", label="J", unit="rad", minimum=-9, maximum=9, slew=1, brake=4, kind="goal", reach=0.5),
    ),
)
NEUTRAL = neutral_values(ARM.axes)
SAG = 0.05


class GoalDriving(RuleBasedStateMachine):
    """One operator "me" with a clutch, and a supervisor "boss" who takes the seat and moves the arm elsewhere.

    Messages between client and console are kept, lost and delayed; the robot link is prompt.
    """

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        # robot
        self.event, self.issue, self.applied = 1, 1, 0.0
        self.neutral_needed, self.stop = True, StopState()
        self.losses = 0  # of the seat, of the arming, by a stop
        self.losses_at: dict[int, int] = {}  # when a feedback was measured, by its nonce
        self.bound_at: dict[float, int] = {}  # losses of the feedback that a goal's engagement was bound to
        # console
        self.clock, self.seat = EventClock(), ControlSeat(SeatTimes())
        self.seat_rules = SeatRules(self.seat)
        self.arbiter = CommandArbiter(self.clock, self.seat)
        self.clock.begin("e")
        self.arbiter.robot_link_up(ARM)
        # network
        self.up: list[Command | Rest] = []
        self.down: list[Feedback | Refusal] = []
        # operator
        self.sender = CommandSender(CommandGate("feedback", 4, 0.0), NEUTRAL)
        self.clutches = Clutches(self.sender, 2.0)
        self.clutch = Clutch(ARM, {"j": 1.0})
        self.clutches.add(self.clutch, 0.0)
        self.device = 0.0
        self.engaged_at = 0

    @initialize()
    def begin(self) -> None:
        self.seat_rules.request("me", "operator", 0.0)
        self.measure()

    # Robot and console

    def measure(self) -> None:
        feedback = Feedback(
            event=self.event,
            issue=self.issue,
            time=0.0,
            axes=[0.0, self.applied - SAG],
            goals=[None, self.applied],
            nonce=1000 * self.event + self.issue,
            neutral_needed=self.neutral_needed,
            stop=self.stop,
        )
        self.losses_at[feedback.nonce] = self.losses
        self.clock.observe(feedback, self.now)
        self.arbiter.feedback(feedback)
        self.down.append(feedback)

    def execute(self, command: Command) -> None:
        goal = command.values[1]
        reason = "stopped" if self.stop.stopped else "not_neutral" if goal is not None and self.neutral_needed else ""
        if goal is not None and abs(goal - (self.applied - SAG)) > 0.5:
            reason = "jump"
        if reason:
            refusal = Refusal(event=command.event, reason=reason, current=self.event)  # type: ignore[arg-type]
            self.arbiter.refused(refusal)
            self.down.append(refusal)
            return
        if goal is None:
            # One that was decided before the robot asked for it does not count (docs/robot-link.md).
            self.neutral_needed &= self.losses_at[command.nonce] < self.losses
        else:
            assert self.bound_at[goal] == self.losses, "a goal of before a loss executes after it"
            self.applied += max(-0.1, min(0.1, goal - self.applied))
        self.event, self.issue = command.event, 1
        self.measure()

    @rule()
    def refresh(self) -> None:
        self.issue += 1
        self.measure()

    @rule(where=st.floats(-0.4, 0.4))
    def boss_drives(self, where: float) -> None:
        """Take the seat, send a neutral command, move the arm, and give the seat back."""
        self.losses += 1
        self.seat_rules.take("boss", "supervisor", self.now)
        self.sender.seat_changed(False)
        self.step()
        self.event = event_after(self.event)
        self.issue = 1
        self.applied += where
        self.measure()
        self.seat_rules.release("boss", self.now)
        self.seat_rules.request("me", "operator", self.now)
        self.sender.seat_changed(True)
        self.step()

    @rule(pushed=st.floats(-1.0, 1.0))
    def stop_and_reset(self, pushed: float) -> None:
        """The arm is moved by hand between the two."""
        self.losses += 1
        self.stop = StopState(stopped=True, number=self.stop.number + 1)
        self.neutral_needed = True
        self.issue += 1
        self.measure()
        self.stop = StopState(number=self.stop.number)
        self.applied += pushed
        self.issue += 1
        self.measure()

    @rule()
    def robot_asks_for_a_neutral_command(self) -> None:
        self.losses += 1
        self.neutral_needed = True
        self.issue += 1
        self.measure()

    # Network

    @rule()
    def everything_arrives(self) -> None:
        for _ in range(8):
            while self.up:
                self.deliver(self.up.pop(0))
            while self.down:
                self.hear(self.down.pop(0))
            self.now += 0.001
            self.step()

    @precondition(lambda self: not self.clutch.engaged)
    @rule()
    def arm_and_engage(self) -> None:
        self.arm()
        self.everything_arrives()
        self.engage(self.device + 7.0)
        self.everything_arrives()

    @precondition(lambda self: self.up)
    @rule(data=st.data(), keep=st.booleans())
    def arrive(self, data: st.DataObject, keep: bool) -> None:
        index = data.draw(st.integers(0, len(self.up) - 1))
        self.deliver(self.up[index] if keep else self.up.pop(index))

    def deliver(self, message: Command | Rest) -> None:
        outcome = (
            self.arbiter.rest("me", message)
            if isinstance(message, Rest)
            else self.arbiter.command("me", message, self.now)
        )
        match outcome:
            case Forward(command):
                self.execute(command)
            case Answer(feedback):
                self.down.append(feedback)
            case Refuse(refusal):
                self.down.append(refusal)
            case ForwardRest():
                self.issue += 1
                self.measure()

    @precondition(lambda self: self.up)
    @rule(data=st.data())
    def lose(self, data: st.DataObject) -> None:
        self.up.pop(data.draw(st.integers(0, len(self.up) - 1)))

    @precondition(lambda self: self.down)
    @rule(data=st.data())
    def answer(self, data: st.DataObject) -> None:
        self.hear(self.down.pop(data.draw(st.integers(0, len(self.down) - 1))))

    def hear(self, message: Feedback | Refusal) -> None:
        if isinstance(message, Refusal):
            self.sender.refusal(message)
        elif self.sender.feedback(message, self.now):
            self.clutches.feedback(message, self.now)
        self.step()

    # Operator

    def step(self) -> None:
        for message in self.sender.due(self.now):
            self.check_sent(message)
            self.clutches.sent(message)
            self.up.append(message)
        self.clutches.settle()
        self.sender.outcomes()

    def check_sent(self, message: Command | Rest) -> None:
        if not isinstance(message, Command) or message.values[1] is None:
            return
        # The robot refuses what is under way when it asks for a neutral command.
        assert self.clutch.engaged or not self.sender.readiness.ready, "a goal left without an engaged clutch"

    @rule(seconds=st.sampled_from([0.01, 0.05, 0.3, 3.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.step()

    @rule()
    def arm(self) -> None:
        self.sender.arm()
        self.step()

    @rule(where=st.floats(-50, 50))
    def engage(self, where: float) -> None:
        """Anywhere; the first goal is the applied goal of the newest feedback."""
        self.device = where
        if self.sender.readiness.ready and self.clutch.engage([where]):
            newest = self.sender.newest
            assert newest is not None
            assert self.clutch.goals([where]) == [newest.goals[1]]
            self.engaged_at = self.losses_at[newest.nonce]
        self.drive()

    @rule(motion=st.floats(-0.3, 0.3))
    def move(self, motion: float) -> None:
        before = self.clutch.goals([self.device])[0]
        self.device += motion
        goal = self.clutch.goals([self.device])[0]
        if before is not None:
            assert goal is not None
            assert abs(goal - before) <= abs(motion) + 1e-9
        self.drive()

    @rule()
    def let_go(self) -> None:
        self.clutch.release()
        if self.sender.readiness.ready:
            self.sender.intend(NEUTRAL, self.now)
        self.step()

    @rule()
    def rest(self) -> None:
        self.sender.rest(self.now)
        self.clutches.release()
        self.step()

    def drive(self) -> None:
        """As a program does: what the clutch says, once `ready`."""
        if self.sender.readiness.ready:
            (goal,) = self.clutch.goals([self.device])
            if goal is not None:
                self.bound_at[goal] = max(self.engaged_at, self.bound_at.get(goal, 0))
            self.sender.intend([0.0, goal], self.now)
        self.step()

    @invariant()
    def engaged_only_where_the_robot_may_move(self) -> None:
        assert not self.clutch.engaged or self.sender.readiness.ready


TestGoalDriving = GoalDriving.TestCase
TestGoalDriving.settings = settings(max_examples=150, stateful_step_count=60, deadline=None)
