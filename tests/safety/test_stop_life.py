"""Random lives of a STOP, from the press to the next motion, through the real cores of the console and the bridge.

Most rules are whole spells ("a second passes, and somebody resets"), so that a life gets from a stop to the next
motion again and again; the others disturb it between any two messages.
"""

from collections.abc import Callable, Iterator

import pytest
from hypothesis import event, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from lockstep.protocol.messages import Command, Reset
from lockstep.protocol.serial import MAX_EVENT, event_after
from tests.robot_bridge.control.core_helpers import NEUTRAL
from tests.safety.stop_world import LINKS, MOVE, PEOPLE, Link, World

pytestmark = pytest.mark.slow

people = st.sampled_from(list(PEOPLE))
links = st.sampled_from(LINKS)
few = st.integers(0, 3)
mostly = st.sampled_from([True, True, True, False])
seldom = st.sampled_from([False, False, False, True])


class StopLife(RuleBasedStateMachine):
    @initialize(first_event=st.sampled_from([1, MAX_EVENT - 2]))
    def begin(self, first_event: int) -> None:
        self.world = World(first_event=first_event)
        self.sent: list[Command] = []
        self.world.arm_and_drive()  # so that what undoes a stop shows as motion at once
        assert self.world.bridge.driven

    def teardown(self) -> None:
        if hasattr(self, "world"):
            event(f"moved again after a stop: {min(self.world.moved, 3)}")
            self.world.close()

    # spells

    @rule()
    def somebody_arms_and_drives(self) -> None:
        self.world.arm_and_drive()

    @rule()
    def the_holder_goes_on_with_the_held_stick(self) -> None:
        self.world.drive(MOVE)

    @rule(person=people, http=st.booleans())
    def somebody_stops_it(self, person: str, http: bool) -> None:
        self.world.press(person, http=http)
        self.world.pump()

    @rule(person=st.sampled_from(["sue", "sue", "ann", "bob"]), http=st.booleans())
    def a_second_passes_and_somebody_resets(self, person: str, http: bool) -> None:
        self.world.let_a_second_pass_and_reset(person, http=http)

    @rule(held=st.booleans(), http=st.booleans())
    def all_is_put_right_and_somebody_drives_on(self, held: bool, http: bool) -> None:
        """With the stick held all the while nothing moves; with a neutral command in between it does, after all."""
        world = self.world
        world.bridge.disk_fails = world.disk.fails = False
        world.bridge.unlock()
        for link in LINKS:
            world.connect(link)
        world.wait(2.0)  # what has no answer is sent again, and resets may be asked for again
        world.pump()
        world.let_a_second_pass_and_reset("sue", http=http)
        assert not world.bridge.witness.holds, "nobody can release it"
        if not world.console.holder:
            world.console.sit("bob")
        if held:
            world.drive(MOVE)
        world.drive(NEUTRAL, MOVE)
        assert world.bridge.driven, "nobody can drive it"
        assert not world.console.keeper.presses.pending, "a press waits though all is up"

    @rule(person=people, seconds=st.sampled_from([0.0, 0.5, 0.98]))
    def somebody_stops_it_and_resets_at_once(self, person: str, seconds: float) -> None:
        self.world.press(person)
        self.world.pump()
        self.world.wait(seconds)
        self.world.reset("sue")
        self.world.pump()

    @rule(first=people, second=people)
    def a_second_passes_and_somebody_resets_while_another_stop_is_on_its_way(self, first: str, second: str) -> None:
        world = self.world
        world.connect("operator")
        world.press(first)
        world.pump()
        world.wait(1.1)
        world.pump()
        world.press(second)
        world.reset("sue")
        world.pump()

    @rule(person=people, offset=st.sampled_from([-1, 1]), late=st.booleans())
    def a_second_passes_and_somebody_resets_another_stop(self, person: str, offset: int, late: bool) -> None:
        world = self.world
        world.connect("operator")
        world.press(person)
        world.pump()
        world.wait(1.1)
        if late:  # the console let it pass when that stop was the newest
            world.to_bridge["operator"].append(Reset(number=max(0, world.bridge.core.stops.state.number + offset)))
        else:
            world.reset("sue", offset)
        world.pump()

    @rule(person=people, values=st.sampled_from([NEUTRAL, MOVE]), arrives=few)
    def the_holder_goes_on_while_a_stop_is_on_its_way(self, person: str, values: list[float], arrives: int) -> None:
        self.world.press(person)
        if self.world.console.holder:
            self.world.command(self.world.console.holder, values)
        self.world.arrive("operator", arrives)

    @rule(person=people)
    def somebody_resets_a_stop_that_no_feedback_has_shown(self, person: str) -> None:
        world = self.world
        world.pump()
        world.press(person)
        world.arrive("operator")
        world.wait(1.1)
        world.to_bridge["operator"].append(Reset(number=world.bridge.core.stops.state.number))
        world.arrive("operator")
        world.write()

    @rule(first=people, second=people, arrives=few)
    def two_press_while_the_link_is_lost(self, first: str, second: str, arrives: int) -> None:
        self.world.press(first)
        self.world.press(second, http=True)
        self.world.lose_all(arrives)
        self.world.wait(1.1)

    @rule(person=people, link=links, in_order=st.booleans())
    def a_stop_arrives_and_the_bridge_ends_before_its_disk_has_it(
        self, person: str, link: Link, in_order: bool
    ) -> None:
        self.world.press(person)
        self.world.arrive(link)
        self.world.restart_bridge(in_order=in_order)

    @rule()
    def a_stop_comes_while_a_reset_waits_for_the_disk(self) -> None:
        world = self.world
        world.pump()
        world.wait(1.1)
        world.reset("sue")
        world.arrive("operator")
        world.press("bob")
        world.arrive("operator")
        world.pump()

    @rule(cause=st.sampled_from(["held up", "unlocked", "operator"]))
    def a_neutral_command_is_on_its_way_when_something_holds_the_robot(self, cause: str) -> None:
        world = self.world
        world.pump()
        if world.console.holder:
            world.command(world.console.holder, NEUTRAL)
        if cause == "held up":
            world.bridge.held_up()
        elif cause == "unlocked":
            world.bridge.lock("key switch")
            world.bridge.unlock()
        else:
            world.bridge.operator_comes()
        world.drive(MOVE)

    @rule(person=st.sampled_from(["sue", "ann"]), arrives=few)
    def the_robot_is_locked_while_somebody_resets(self, person: str, arrives: int) -> None:
        self.world.bridge.lock("key switch")
        self.world.let_a_second_pass_and_reset(person)

    # single steps

    @rule(person=people, again=seldom, http=st.booleans())
    def press(self, person: str, again: bool, http: bool) -> None:
        self.world.press(person, again=again, http=http)

    @rule(person=people, which=st.integers(0, 5), http=st.booleans(), drives=mostly)
    def somebody_stops_it_with_an_id_that_was_used_before(
        self, person: str, which: int, http: bool, drives: bool
    ) -> None:
        world = self.world
        if not world.presses or world.console.people.all[person].silenced:
            return
        if drives:
            world.arm_and_drive()
        for link in LINKS:
            world.connect(link)
        world.press_as(person, world.presses[-1 - min(which, len(world.presses) - 1)], http=http)
        world.wait(0.2)  # one that comes too fast is held for so long
        world.pump()
        assert not world.bridge.driven, "a press had no effect on a robot that moves"

    @rule(person=people, offset=st.sampled_from([0, 0, -1, 1]), http=st.booleans())
    def reset(self, person: str, offset: int, http: bool) -> None:
        self.world.reset(person, offset, http=http)

    @rule(person=people, values=st.sampled_from([NEUTRAL, MOVE]))
    def command(self, person: str, values: list[float]) -> None:
        self.world.command(person, values)

    @rule(values=st.sampled_from([NEUTRAL, MOVE]), nonce=st.sampled_from([0, 1, 12345]), past_the_console=st.booleans())
    def somebody_answers_what_nobody_has_sent(self, values: list[float], nonce: int, past_the_console: bool) -> None:
        feedback = self.world.bridge.feedback
        if nonce == feedback.nonce:
            return
        forged = Command(event=event_after(feedback.event), issue=feedback.issue, values=values, nonce=nonce)
        if past_the_console:
            self.world.bridge.receive(forged)
        elif self.world.console.holder:
            self.world.console.command(self.world.console.holder, forged)

    @rule(offset=st.sampled_from([-1, 0, 1]))
    def a_reset_that_was_held_up_arrives(self, offset: int) -> None:
        number = max(0, self.world.bridge.core.stops.state.number + offset)
        self.world.to_bridge["operator"].append(Reset(number=number))

    @rule(person=people)
    def sit(self, person: str) -> None:
        self.world.console.sit(person)

    @rule()
    def leave_the_seat(self) -> None:
        self.world.console.release()

    @rule(person=people, silent=mostly)
    def sue_silences_somebody(self, person: str, silent: bool) -> None:
        people = self.world.console.people.all
        self.world.console.silence.silence(people["sue"], people[person].id, silent=silent)  # type: ignore[arg-type]

    @rule(link=links, count=st.integers(1, 3))
    def arrive(self, link: Link, count: int) -> None:
        self.world.arrive(link, count)

    @rule(link=links, count=st.integers(1, 3))
    def hear(self, link: Link, count: int) -> None:
        self.world.hear(link, count)

    @rule(seconds=st.sampled_from([0.0, 0.3, 0.6, 1.0, 2.1, 700.0]))
    def wait(self, seconds: float) -> None:
        self.world.wait(seconds)

    @rule()
    def tick(self) -> None:
        self.world.tick()

    @rule()
    def write(self) -> None:
        self.world.write()

    # what goes wrong

    @rule(link=links, arrives=few)
    def lose(self, link: Link, arrives: int) -> None:
        self.world.lose(link, arrives)

    @rule(link=links)
    def connect(self, link: Link) -> None:
        self.world.connect(link)

    @rule(in_order=st.booleans(), file_lost=seldom, arrives=few)
    def the_bridge_restarts(self, in_order: bool, file_lost: bool, arrives: int) -> None:
        self.world.restart_bridge(in_order=in_order, file_lost=file_lost, arrives=arrives)

    @rule(killed=st.booleans(), arrives=few)
    def the_console_restarts(self, killed: bool, arrives: int) -> None:
        self.world.restart_console(killed=killed, arrives=arrives)

    @rule(fails=seldom, which=st.sampled_from(["robot", "console"]))
    def a_disk_fails_or_works(self, fails: bool, which: str) -> None:
        if which == "robot":
            self.world.bridge.disk_fails = fails
        else:
            self.world.disk.fails = fails

    @rule(suspended=st.sampled_from([0.0, 3600.0]))
    def the_robot_has_a_fault_or_is_suspended(self, suspended: float) -> None:
        self.world.wait(suspended)
        self.world.bridge.held_up()

    @rule(microseconds=st.sampled_from([-(10**12), -5, 10**6]))
    def the_wall_clock_jumps(self, microseconds: int) -> None:
        self.world.wall += microseconds

    @rule()
    def somebody_locks_the_robot(self) -> None:
        self.world.bridge.lock("key switch")

    @rule()
    def somebody_unlocks_it(self) -> None:
        self.world.bridge.unlock()

    @invariant()
    def nothing_moves_while_a_stop_holds_and_no_press_is_lost(self) -> None:
        if hasattr(self, "world"):
            self.world.check()


StopLife.TestCase.settings = settings(
    max_examples=300, stateful_step_count=40, deadline=None, derandomize=False, print_blob=True
)
TestStopLife = StopLife.TestCase


@pytest.fixture
def world() -> Iterator[World]:
    world = World()
    world.arm_and_drive()
    yield world
    world.close()


def test_a_robot_that_is_driven_stopped_reset_and_armed_as_it_should_be_moves(world: World) -> None:
    """Or nothing above would be worth anything."""
    states = [(world.bridge.driven, world.bridge.witness.holds)]
    steps: list[Callable[[], None]] = [
        lambda: world.press("olga", http=True),
        world.pump,
        lambda: world.drive(NEUTRAL, MOVE),
        world.let_a_second_pass_and_reset,
        lambda: world.drive(MOVE),
        lambda: world.drive(NEUTRAL, MOVE),
    ]
    for step in steps:
        step()
        states.append((world.bridge.driven, world.bridge.witness.holds))
    assert states == [
        (True, False),
        (True, False),
        (False, True),
        (False, True),
        (False, False),
        (False, False),
        (True, False),
    ]
    assert len(world.promises.delivered) == 1


@pytest.mark.parametrize("http", [False, True])
@pytest.mark.parametrize("restarts", [False, True])
def test_no_choice_of_a_press_id_keeps_a_stop_from_stopping_a_robot_that_moves(
    world: World, http: bool, restarts: bool
) -> None:
    def stopped() -> bool:
        return world.bridge.witness.holds

    for number, person in enumerate(("olga", "olga", "bob", "sue"), 1):
        world.press_as(person, "ab" * 16, http=http)
        world.pump()
        assert stopped()
        assert len(world.bridge.witness.given) == number
        world.let_a_second_pass_and_reset()
        world.press_as(person, "ab" * 16, http=http)
        world.pump()
        assert not stopped(), "a copy that comes late does not undo a reset"
        if restarts:
            world.restart_console(killed=True)
        world.arm_and_drive()
        assert world.bridge.driven


def test_after_a_lost_link_a_restart_and_a_reset_an_eager_holder_moves_nothing_without_a_neutral_command(
    world: World,
) -> None:
    def lose() -> None:
        world.lose("operator")

    def restart_bridge() -> None:
        world.restart_bridge(in_order=True)

    def restart_console() -> None:
        world.restart_console(killed=True)
        world.console.sit("ann")

    def stop_and_reset() -> None:
        world.press("bob")
        world.let_a_second_pass_and_reset()

    for happens in (lose, restart_bridge, restart_console, stop_and_reset):
        happens()
        world.connect("operator")
        world.drive(MOVE, MOVE)
        assert not world.bridge.driven, happens.__name__
        world.drive(NEUTRAL, MOVE)
        assert world.bridge.driven, happens.__name__


def test_a_press_that_the_robot_could_not_be_told_of_outlives_a_console_that_is_killed(world: World) -> None:
    world.lose_all()
    world.press("bob", http=True)
    assert world.promises.kept == set(world.presses)
    world.restart_console(killed=True)
    world.connect("media")  # the other link is another console's, say
    world.wait(0.6)
    world.pump()
    assert world.bridge.witness.holds
    assert not world.disk.files


def test_a_stop_is_said_to_another_run_of_the_bridge_also_where_only_the_link_for_media_is_up(world: World) -> None:
    world.press("bob")
    world.pump()
    world.wait(0.2)  # the console has nothing left to wait for
    world.restart_bridge(in_order=True, file_lost=True)
    world.connect("media")
    world.wait(0.6)
    world.arrive("media")
    assert world.presses[0] in world.bridge.acknowledged
