"""The life of a STOP through the real core of the bridge, the real desk, presses and seat, in any order of events.

What is on its way between console and bridge is a list that a lost link empties. Nothing waits for real time.
"""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from robot_bridge.event_core import EventCore, Executed
from robot_bridge.protocol.description import Axis, RobotDescription
from robot_bridge.protocol.messages import Command, Feedback, Stop, StopTaken
from robot_bridge.protocol.serial import event_after
from robot_bridge.robots.base import Measurement
from robot_bridge.stop_latch import ResetTaken, StopLatch, StopRecord
from server.command_desk import CommandDesk, Forward
from server.event_clock import EventClock
from server.seat import ControlSeat, SeatTimes
from server.stop_presses import NewPress, Press, StopPresses

ROBOT = RobotDescription(
    name="r", label="R", axes=(Axis(name="x", label="x", unit="m/s", minimum=-1, maximum=1, slew=1, brake=1),)
)
MEASURED = Measurement(axes=[0.0], joints=[], wrench=[], ranges=[], at_rest=True, faults=[])
REST, MOVE = [0.0], [0.5]
people = st.sampled_from(["ann", "bob"])


class StopLife(RuleBasedStateMachine):
    @initialize()
    def start(self) -> None:
        self.now = 100.0
        self.pressed = 0
        self.made: list[str] = []  # every press, ever
        self.delivered: dict[str, int] = {}  # press -> number that its presser was told
        self.record: StopRecord | None = None  # the bridge's disk
        self.epochs = 0
        self.up = False
        self.released = True  # nobody has stopped it since a reset that named the newest stop
        self.neutral = False  # and a neutral command was executed after that
        self.holder = ""
        self.console_starts()
        self.bridge_starts()
        self.link_up()
        self.sit("ann", supervisor=False)
        self.drive_on(neutral_first=True)  # so that what undoes a stop would show as motion at once

    def bridge_starts(self) -> None:
        self.latch = StopLatch(self.record)
        self.core = EventCore(ROBOT.axes, max_event_age=2.0)
        self.core.begin(self.latch)
        self.core.issue(MEASURED, self.now)
        self.neutral = False

    def console_starts(self, kept: list[Press] | None = None) -> None:
        self.clock, self.seat, self.presses = EventClock(), ControlSeat(SeatTimes()), StopPresses()
        self.desk = CommandDesk(self.clock, self.seat, self.presses)
        for press in kept or []:
            self.presses.again(press)
        self.to_bridge: list[Command | Stop] = []
        self.to_console: list[Feedback | StopTaken] = []

    # links

    @rule()
    def link_up(self) -> None:
        if self.up:
            return
        self.up = True
        epoch = str(self.epochs)
        if epoch != self.clock.epoch:
            held = self.clock.stop
            if held.stopped and held.press:
                self.presses.again(Press(id=held.press))
            self.desk.epoch_ends()
            self.clock.begin(epoch)
        self.to_bridge += [press.message() for press in self.presses.pending]
        self.desk.link_up(ROBOT)
        self.core.need_neutral()
        self.neutral = False
        self.issue()

    @rule()
    def link_down(self) -> None:
        self.up, self.to_bridge, self.to_console = False, [], []
        self.desk.link_down()

    @rule()
    def restart_bridge(self) -> None:
        self.link_down()
        self.record = self.latch.record
        self.epochs += 1
        self.bridge_starts()

    @rule()
    def restart_console(self) -> None:
        self.link_down()
        self.console_starts(self.presses.pending)

    # people

    @rule(person=people, supervisor=st.booleans())
    def sit(self, person: str, supervisor: bool) -> None:
        if supervisor:
            self.seat.take(person, "supervisor", self.now)
        else:
            self.seat.request(person, "operator", self.now)
        if self.seat.holder != self.holder:
            self.holder = self.seat.holder
            self.desk.abandon()

    @rule(again=st.booleans())
    def press(self, again: bool) -> None:
        if again and self.made:
            name = self.made[-1]
        else:
            self.pressed += 1
            name = f"press {self.pressed}"
            self.made.append(name)
        if isinstance(self.presses.press(Press(id=name)), NewPress) and self.up:
            self.to_bridge.append(Stop(press=name))

    @rule(offset=st.integers(-1, 1), seconds=st.sampled_from([0.0, 0.5, 1.5]))
    def reset(self, offset: int, seconds: float) -> None:
        """By somebody with the right, who names this or another stop, soon or later. It arrives after what was sent."""
        if not self.up or self.presses.pending:
            return  # the console refuses it
        self.arrive(len(self.to_bridge))
        self.now += seconds
        number = max(0, self.clock.stop.number + offset)
        newest = self.core.stop_state.number
        if isinstance(self.core.reset(number, self.now), ResetTaken):
            assert number == newest
            self.released, self.neutral = True, False

    @rule(person=people, values=st.sampled_from([REST, MOVE]), stale=st.booleans(), forged=st.booleans())
    def command(self, person: str, values: list[float], stale: bool, forged: bool) -> None:
        feedback = self.clock.feedback
        if feedback is None:
            return
        issue = 1 if stale else feedback.issue
        nonce = 12345 if forged else feedback.nonce
        command = Command(event=event_after(feedback.event), issue=issue, values=values, nonce=nonce)
        outcome = self.desk.command(person, command, self.now)
        if isinstance(outcome, Forward):
            assert self.seat.holder == person
            assert not forged
            assert not self.presses.pending
            self.to_bridge.append(outcome.command)

    # what is on its way

    @rule(count=st.integers(1, 3))
    def arrive(self, count: int) -> None:
        for message in self.to_bridge[:count]:
            self.at_bridge(message)
        del self.to_bridge[:count]

    def at_bridge(self, message: Command | Stop) -> None:
        if isinstance(message, Stop):
            given = self.core.stop(message.press, message.by, message.reason, self.now)
            if given.is_new:
                self.released = self.neutral = False
            self.to_console.append(StopTaken(press=message.press, number=given.number))
            return
        outcome = self.core.command(message, self.now)
        if isinstance(outcome, Executed):
            assert not self.core.stop_state.stopped
            if outcome.values == REST:
                self.neutral = True
            else:
                assert self.released, "it moves though nobody reset the newest stop"
                assert self.neutral, "it moves without a neutral command since"
        else:
            self.desk.link_down()  # the refusal's feedback is not modelled: the desk forgets what was in flight
            if self.up:
                self.desk.link_up(ROBOT)

    @rule()
    def issue(self) -> None:
        feedback = self.core.issue(MEASURED, self.now)
        if self.up:
            self.to_console.append(feedback)

    @rule(count=st.integers(1, 4))
    def hear(self, count: int) -> None:
        for message in self.to_console[:count]:
            if isinstance(message, StopTaken):
                self.desk.stop_taken(message)
                self.delivered |= {each.press.id: each.taken.number for each in self.presses.taken(message)}
            elif self.clock.observe(message, self.now):
                self.desk.feedback(message)
        del self.to_console[:count]

    @rule(seconds=st.sampled_from([0.1, 1.1, 3.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds

    @rule(inside=st.booleans())
    def lock_out(self, inside: bool) -> None:
        if inside:
            if self.core.lock_out("somebody is at the robot", self.now) is not None:
                self.released = self.neutral = False
        elif self.core.let_in():
            self.neutral = False

    @rule(neutral_first=st.booleans())
    def drive_on(self, neutral_first: bool) -> None:
        """All that an eager holder does at once, so that motion is reached often."""
        for values in (REST, MOVE) if neutral_first else (MOVE,):
            self.issue()
            self.hear(1000)
            if self.seat.holder:
                self.command(self.seat.holder, values, stale=False, forged=False)
            self.arrive(1000)

    @invariant()
    def a_press_is_never_lost(self) -> None:
        """Each has a number that its presser was told, or is pending, and so is sent again."""
        if hasattr(self, "made"):
            assert all(name in self.delivered or self.presses.is_pending(name) for name in self.made)
            assert all(number > 0 for number in self.delivered.values())


StopLife.TestCase.settings = settings(max_examples=300, stateful_step_count=40, deadline=None)
TestStopLife = StopLife.TestCase


def test_the_machine_does_reach_motion_and_a_stop_a_reset_and_motion_again() -> None:
    life = StopLife()
    life.start()
    assert life.core.pending is not None
    life.press(again=False)
    life.arrive(10)
    life.issue()
    life.hear(100)
    assert (life.released, life.core.stop_state.stopped) == (False, True)
    life.drive_on(neutral_first=True)
    life.reset(offset=0, seconds=1.5)
    event = life.core.current
    life.drive_on(neutral_first=True)
    assert (life.released, life.core.pending) == (True, event + 2)


def test_after_a_lost_link_a_restart_and_a_reset_an_eager_holder_moves_nothing_without_a_neutral_command() -> None:
    for what in ("link", "bridge", "console", "reset"):
        life = StopLife()
        life.start()
        if what == "link":
            life.link_down()
        elif what == "bridge":
            life.restart_bridge()
        elif what == "console":
            life.restart_console()
            life.sit("ann", supervisor=True)
        else:
            life.press(again=False)
            life.arrive(10)
            life.issue()
            life.hear(100)
            life.reset(offset=0, seconds=1.5)
        life.link_up()
        event = life.core.current
        life.drive_on(neutral_first=False)
        assert (life.core.current, life.core.pending) == (event, None), what
        life.sit("ann", supervisor=True)
        life.drive_on(neutral_first=True)
        assert life.core.pending is not None, what
