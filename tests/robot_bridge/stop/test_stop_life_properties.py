"""Random lives of a STOP: whatever happens in whatever order, the robot moves only after a reset that names the newest
stop, then a neutral command, then another."""

from collections.abc import Callable

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from lockstep.protocol.messages import Command, Feedback, LinkMessage, Reset, Rest, Stop, StopTaken
from lockstep.protocol.serial import MAX_EVENT, event_after
from tests.robot_bridge.bridge_model import BridgeModel
from tests.robot_bridge.control.core_helpers import NEUTRAL

pytestmark = pytest.mark.slow

MOVES = [[0.5, 0.2], [-1.0, 0.3]]
PRESSES = ["", "a" * 32, "b" * 32, "c" * 32]


class StopLife(RuleBasedStateMachine):
    """Everybody sends what they like, and the network delivers any copy at any time."""

    @initialize(first=st.sampled_from([1, MAX_EVENT - 1]), keeps=st.sampled_from([True, True, True, False]))
    def begin(self, first: int, keeps: bool) -> None:
        self.wall = 0
        self.bridge = BridgeModel(first_event=first, keeps=keeps, wall=lambda: self.wall)
        self.seen: list[Feedback] = [self.bridge.feedback]
        self.sent: list[Command | Rest | Stop | Reset] = []
        self.moved = 0

    def heard(self, messages: list[LinkMessage]) -> None:
        for message in messages:
            if isinstance(message, Feedback):
                self.seen.append(message)
            elif isinstance(message, StopTaken):
                assert message.number in self.bridge.witness.given

    def deliver(self, message: Command | Rest | Stop | Reset) -> None:
        self.sent.append(message)
        self.heard(self.bridge.receive(message))
        self.moved += self.bridge.driven

    def answer(self, feedback: Feedback, values: list[float]) -> Command:
        event = event_after(feedback.event)
        return Command(event=event, issue=feedback.issue, nonce=feedback.nonce, values=values)

    @rule(seconds=st.sampled_from([0.0, 0.004, 0.3, 0.999, 1.0, 2.1, 3600.0]))
    def time_passes(self, seconds: float) -> None:
        self.bridge.now += seconds

    @rule(microseconds=st.sampled_from([-(10**12), -5, 10**6]))
    def the_wall_clock_jumps(self, microseconds: int) -> None:
        self.wall += microseconds

    @rule()
    def a_tick_ends(self) -> None:
        self.bridge.now += 0.004
        self.heard(self.bridge.tick())

    @rule(values=st.sampled_from([NEUTRAL, *MOVES]), back=st.integers(0, 4))
    def the_operator_answers(self, values: list[float], back: int) -> None:
        self.deliver(self.answer(self.seen[-1 - min(back, len(self.seen) - 1)], values))

    @rule(moves=st.sampled_from(MOVES))
    def the_operator_drives_as_it_should(self, moves: list[float]) -> None:
        for values in (NEUTRAL, moves):
            self.a_tick_ends()
            self.deliver(self.answer(self.seen[-1], values))

    @rule()
    def the_bridge_is_held_up_while_a_neutral_command_is_on_its_way(self) -> None:
        on_its_way = self.answer(self.seen[-1], NEUTRAL)
        self.bridge.held_up()
        self.deliver(on_its_way)
        self.a_tick_ends()

    @precondition(lambda self: self.sent)
    @rule(data=st.data())
    def the_network_delivers_a_copy(self, data: st.DataObject) -> None:
        self.heard(self.bridge.receive(data.draw(st.sampled_from(self.sent[-15:]))))

    @rule(ahead=st.integers(-1, 1))
    def the_operator_rests(self, ahead: int) -> None:
        event = (self.bridge.core.current + ahead) % 2**31
        if event:
            self.deliver(Rest(event=event))

    @rule(press=st.sampled_from(PRESSES))
    def somebody_stops(self, press: str) -> None:
        self.deliver(Stop(press=press, by="somebody"))

    @rule(offset=st.sampled_from([0, 0, 0, -1, 1]))
    def somebody_resets(self, offset: int) -> None:
        self.deliver(Reset(number=max(0, self.seen[-1].stop.number + offset)))

    @rule()
    def somebody_resets_as_they_should(self) -> None:
        self.a_tick_ends()
        self.bridge.now += 1.0
        self.deliver(Reset(number=self.seen[-1].stop.number))
        self.the_disk_writes()

    @rule()
    def the_disk_writes(self) -> None:
        self.heard(self.bridge.write())

    @rule(fails=st.booleans())
    def the_disk_fails_or_works(self, fails: bool) -> None:
        self.bridge.disk_fails = fails

    @rule()
    def the_operator_link_is_lost_and_comes_back(self) -> None:
        self.bridge.operator_lost()
        self.bridge.operator_comes()

    @rule()
    def the_bridge_is_held_up(self) -> None:
        self.bridge.held_up()

    @rule()
    def somebody_locks_the_robot(self) -> None:
        self.bridge.lock("key switch")

    @rule()
    def somebody_unlocks_the_robot(self) -> None:
        self.bridge.unlock()

    @rule(in_order=st.booleans(), file_lost=st.sampled_from([False, False, True]))
    def the_bridge_restarts(self, in_order: bool, file_lost: bool) -> None:
        locked = self.bridge.witness.locked
        self.bridge.restart(in_order=in_order, file_lost=file_lost)
        if locked:
            self.bridge.lock("key switch")
        self.seen = [self.bridge.feedback]

    @invariant()
    def nothing_moves_while_a_stop_holds(self) -> None:
        assert not (self.bridge.driven and self.bridge.witness.holds)
        assert self.bridge.core.stops.state.stopped == self.bridge.witness.holds

    @invariant()
    def what_is_said_to_be_kept_is_on_the_disk(self) -> None:
        if self.bridge.core.stops.state.kept:
            disk = self.bridge.disk
            assert disk is not None
            assert disk.latch.stopped == self.bridge.witness.holds
            assert disk.latch.number == self.bridge.core.stops.state.number


StopLife.TestCase.settings = settings(max_examples=150, stateful_step_count=60, deadline=None)
TestStopLife = StopLife.TestCase


def test_a_robot_that_is_driven_stopped_reset_and_armed_as_it_should_be_moves() -> None:
    """Or nothing above would be worth anything."""
    life = StopLife()
    life.begin(1, True)
    states = []
    steps: list[Callable[[], object]] = [
        lambda: life.the_operator_drives_as_it_should(MOVES[0]),
        lambda: life.somebody_stops("a" * 32),
        lambda: life.the_disk_writes(),
        lambda: life.somebody_resets_as_they_should(),
        lambda: life.the_operator_drives_as_it_should(MOVES[0]),
    ]
    for step in steps:
        step()
        states.append((life.bridge.driven, life.bridge.witness.holds))
    assert states == [(True, False), (False, True), (False, True), (False, False), (True, False)]
