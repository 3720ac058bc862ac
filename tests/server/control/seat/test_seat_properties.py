"""The seat with the arbiter behind it, in any order of inputs.

Never pinned, one driver, rest before the next; a policy drives only while a person lets it.
"""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, Rest
from lockstep.protocol.serial import event_after
from lockstep.server.control.command_arbiter import CommandArbiter, Forward, ForwardRest
from lockstep.server.control.seat.claims import MAX_CLAIMS
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_table import SeatInput, SeatOutcome
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.event_clock import EventClock

TIMES = SeatTimes(heartbeat=3.0, idle=5.0, claim=6.0)
ROBOT = RobotDescription(
    name="r", label="R", axes=(Axis(name="x", label="x", unit="m/s", minimum=-1, maximum=1, slew=1, brake=1),)
)
PEERS = {"a": "operator", "b": "operator", "c": "supervisor", "d": "observer", "p": "policy", "q": "policy"}
POLICIES, PEOPLE = ("p", "q"), ("a", "b", "c")
peers = st.sampled_from(sorted(PEERS))


class SeatMachine(RuleBasedStateMachine):
    """A bridge that executes what it is sent; `sent` is what it gets: (peer, command) or (None, rest)."""

    @initialize()
    def start(self) -> None:
        self.now = 0.0
        self.clock = EventClock()
        self.seat = ControlSeat(TIMES)
        self.seat_rules = SeatRules(self.seat)
        self.arbiter = CommandArbiter(self.clock, self.seat)
        self.clock.begin("epoch")
        self.arbiter.robot_link_up(ROBOT)
        self.sent: list[tuple[str | None, Command | Rest]] = []
        self.event = 0
        self.answer()
        self.heard = dict.fromkeys(PEERS, 0.0)
        self.moved_at = 0.0
        self.offered_to: str | None = None  # as the people have said since the last end of an offer; "": any policy

    def act(self, outcome: SeatOutcome) -> None:
        """As the keeper does."""
        if outcome.rest:
            rest = self.arbiter.abandon()
            if isinstance(rest, ForwardRest):
                self.sent.append((None, rest.rest))

    def watched(self, before: str) -> None:
        """Whenever the holder changed, and somebody held it, the robot was told to rest since."""
        if before and self.seat.holder != before:
            last_rest = max((i for i, (peer, _) in enumerate(self.sent) if peer is None), default=-1)
            assert all(peer is None for peer, _ in self.sent[last_rest:])
            assert last_rest >= 0
        if before != self.seat.holder:
            self.heard[self.seat.holder] = self.moved_at = self.now
            if self.seat.holder in POLICIES:
                assert before == "", "a policy takes the seat from nobody"
                assert self.offered_to in ("", self.seat.holder), "a person has let this policy drive"
            else:
                self.offered_to = None  # a person drives, or the policy's turn is over

    @rule(peer=peers, only_if_free=st.booleans())
    def request(self, peer: str, only_if_free: bool) -> None:
        before = self.seat.holder
        self.act(self.seat_rules.request(peer, PEERS[peer], self.now, only_if_free=only_if_free))  # type: ignore[arg-type]
        if before in POLICIES and peer in PEOPLE and not only_if_free:
            assert self.seat.holder == peer, "a person's one press takes the robot from a policy"
        else:
            assert before in ("", self.seat.holder), "a request deposes no person"
        if before == peer and not only_if_free and peer in PEOPLE:
            self.moved_at = self.now
        self.watched(before)

    @rule(peer=peers)
    def take(self, peer: str) -> None:
        before = self.seat.holder
        self.act(self.seat_rules.take(peer, PEERS[peer], self.now))  # type: ignore[arg-type]
        if PEERS[peer] == "supervisor" or (PEERS[peer] == "operator" and before in ("", peer, *POLICIES)):
            assert self.seat.holder == peer
            self.moved_at = self.now
        else:
            assert self.seat.holder == before
        self.watched(before)

    @rule(peer=peers, to=st.sampled_from(["", "p", "q"]))
    def offer(self, peer: str, to: str) -> None:
        before, claims = self.seat.holder, self.seat.claims.seconds_left(self.now)
        outcome = self.seat_rules.offer_to_policies(peer, PEERS[peer], f"link of {peer}", self.now, to=to)  # type: ignore[arg-type]
        self.act(outcome)
        self.watched(before)
        if peer in PEOPLE and before in ("", peer, *POLICIES) and not claims:
            assert outcome.refusal is None
            assert self.seat.holder == (before if before in POLICIES else "")
            self.offered_to = self.seat.holder or to
        else:
            assert outcome.refusal is not None
            assert self.seat.holder == before

    @rule(peer=peers)
    def withdraw(self, peer: str) -> None:
        before = self.seat.holder
        self.act(self.seat_rules.withdraw_offer(peer, PEERS[peer], self.now))  # type: ignore[arg-type]
        self.watched(before)
        self.offer_is_over(before, ends=peer in PEOPLE)

    @rule(what=st.sampled_from([SeatInput.STOPPED, SeatInput.LINK_LOST]))
    def end_offer(self, what: SeatInput) -> None:
        before = self.seat.holder
        self.act(self.seat_rules.end_offer(what, self.now))
        self.watched(before)
        self.offer_is_over(before, ends=True)

    @rule(peer=st.sampled_from(PEOPLE))
    def person_leaves(self, peer: str) -> None:
        before, offer = self.seat.holder, self.seat.offer
        self.act(self.seat_rules.person_left(f"link of {peer}", self.now))
        self.watched(before)
        self.offer_is_over(before, ends=offer is not None and offer.by == peer)

    def offer_is_over(self, before: str, *, ends: bool) -> None:
        if ends:
            self.offered_to = None
            assert self.seat.offer is None
            assert self.seat.holder == ("" if before in POLICIES else before)
        else:
            assert self.seat.holder == before

    @rule(policy=st.sampled_from(POLICIES), value=st.sampled_from([0.0, 0.5]))
    def policy_begins(self, policy: str, value: float) -> None:
        """A policy that asks at once, and drives whether it has got the seat or not."""
        self.request(policy, only_if_free=True)
        self.command(policy, value, answered=True)

    @rule(peer=peers, claimant=peers, grant=st.booleans())
    def answer_claim(self, peer: str, claimant: str, grant: bool) -> None:
        before, claims = self.seat.holder, self.seat.claims.seconds_left(self.now)
        self.act(self.seat_rules.answer(peer, claimant, self.now, grant=grant))
        if self.seat.holder != before:
            assert (peer, grant) == (before, True)
            assert claimant in claims
        self.watched(before)

    @rule(peer=peers, gone=st.booleans())
    def leave(self, peer: str, gone: bool) -> None:
        before, claims = self.seat.holder, list(self.seat.claims.seconds_left(self.now))
        self.act(self.seat_rules.gone(peer, self.now) if gone else self.seat_rules.release(peer, self.now))
        assert not self.seat.holds(peer)
        assert peer not in self.seat.claims.seconds_left(self.now)
        if before == peer:
            assert self.seat.holder == (claims[0] if claims else "")
        self.watched(before)

    @rule(seconds=st.floats(0.01, 4.0), alive=st.booleans())
    def wait(self, seconds: float, alive: bool) -> None:
        self.now += seconds
        if alive:
            self.hear(self.seat.holder)
            for person in PEOPLE:
                self.seat_rules.attended(f"link of {person}", self.now)
        before = self.seat.holder
        for outcome in self.seat_rules.expire(self.now):
            self.act(outcome)
        if before and self.seat.holder != before:
            overdue = self.now - self.heard[before] >= TIMES.heartbeat or self.now - self.moved_at >= TIMES.idle
            assert overdue or (before in POLICIES and not alive), "or nobody attends the policy"
        self.watched(before)

    @rule(peer=peers)
    def hear(self, peer: str) -> None:
        self.seat_rules.heard(peer, self.now)
        self.heard[peer] = self.now

    @rule(peer=peers, value=st.sampled_from([0.0, 0.5]), answered=st.booleans())
    def command(self, peer: str, value: float, answered: bool) -> None:
        outcome = self.arbiter.command(peer, Command(event=event_after(self.event), issue=1, values=[value]), self.now)
        if isinstance(outcome, Forward):
            assert self.seat.holder == peer
            before = next((each for each in reversed(self.sent) if each[0] != peer), (None, None))
            if before[0] is not None:
                raise AssertionError(f"{peer} drives right after {before[0]}, without a rest between")
            if value:
                own = [message for sender, message in self.since_rest_of_hand_over() if sender == peer]
                assert any(isinstance(each, Command) and each.values == [0.0] for each in own)
                self.act(self.seat_rules.moved(peer, self.now))
                self.moved_at = self.now
            self.sent.append((peer, outcome.command))
            if answered:
                self.answer()

    @rule(value=st.sampled_from([0.0, 0.5]))
    def drive(self, value: float) -> None:
        if self.seat.holder:
            self.command(self.seat.holder, value, answered=True)

    def since_rest_of_hand_over(self) -> list[tuple[str | None, Command | Rest]]:
        last = max((i for i, (peer, _) in enumerate(self.sent) if peer is None), default=-1)
        return self.sent[last + 1 :]

    @rule()
    def answer(self) -> None:
        commands = [message.event for _, message in self.sent if isinstance(message, Command)]
        self.event = max([1, *commands])
        feedback = self.clock.feedback
        issue = 1 if feedback is None or feedback.event != self.event else feedback.issue + 1
        feedback = Feedback(event=self.event, issue=issue, time=0.0, axes=[0.0])
        self.clock.observe(feedback, self.now)
        self.arbiter.feedback(feedback)

    def last_sender(self) -> str | None:
        return self.sent[-1][0]

    @invariant()
    def a_policy_drives_only_while_a_person_lets_it(self) -> None:
        if not hasattr(self, "seat"):
            return
        assert not set(self.seat.claims.seconds_left(self.now)) & set(POLICIES), "a policy waits for no seat"
        if self.seat.holder in POLICIES:
            assert self.seat.policy_drives
            assert self.seat.offer is not None
            assert self.seat.offer.by in PEOPLE
        elif self.seat.holder:
            assert not self.seat.policy_drives
            assert self.seat.offer is None, "no policy drives after this person without a new press"

    @invariant()
    def the_seat_is_never_pinned(self) -> None:
        """Neither by the silent nor by the idle, and nobody waits for a free one."""
        if not hasattr(self, "seat"):
            return
        assert len(self.seat.claims.seconds_left(self.now)) <= MAX_CLAIMS
        assert self.seat.holder or not self.seat.claims.seconds_left(self.now)
        if self.seat.holder:
            assert self.now - self.heard[self.seat.holder] < TIMES.heartbeat + 1e-6
            assert self.now - self.moved_at < TIMES.idle + 1e-6

    def teardown(self) -> None:
        """If nobody says anything from now on it is free within bounded time, whoever waits for it."""
        if not hasattr(self, "seat"):
            return
        claims = len(self.seat.claims.seconds_left(self.now))
        for _ in range(claims + 1):
            self.now += TIMES.heartbeat + 1e-6
            list(self.seat_rules.expire(self.now))
        assert self.seat.holder == ""
        assert not self.seat.claims.seconds_left(self.now)
        self.now += TIMES.claim
        list(self.seat_rules.expire(self.now))
        assert self.seat.offer is None


SeatMachine.TestCase.settings = settings(max_examples=80, stateful_step_count=30, deadline=None)
TestSeatMachine = SeatMachine.TestCase


def test_a_stick_that_is_held_through_a_hand_over_moves_nothing() -> None:
    machine = SeatMachine()
    machine.start()
    machine.request("a", only_if_free=False)
    for value in (0.0, 0.5):
        machine.command("a", value, answered=True)
    machine.take("c")
    machine.command("c", 0.5, answered=True)
    assert machine.sent[-1] == (None, Rest(event=4))
    machine.command("c", 0.0, answered=True)
    machine.command("c", 0.5, answered=True)
    assert [peer for peer, _ in machine.sent] == ["a", "a", None, "c", "c"]


def test_a_policy_gets_no_seat_by_itself_and_loses_it_to_one_press() -> None:
    machine = SeatMachine()
    machine.start()
    machine.request("p", only_if_free=True)
    assert machine.seat.holder == ""
    machine.request("a", only_if_free=False)
    machine.offer("a", "p")
    machine.request("q", only_if_free=True)
    assert machine.seat.holder == "", "the other policy was not meant"
    machine.request("p", only_if_free=True)
    for value in (0.5, 0.0, 0.5):
        machine.command("p", value, answered=True)
    assert machine.last_sender() == "p"
    machine.request("b", only_if_free=False)
    assert (machine.seat.holder, machine.seat.why) == ("b", "taken")
    assert machine.last_sender() is None, "the robot rests"
    machine.command("p", 0.5, answered=True)
    machine.command("b", 0.5, answered=True)
    assert machine.last_sender() is None, "the policy has no seat, and the person has to arm"
    machine.request("p", only_if_free=True)
    machine.leave("b", gone=False)
    machine.request("p", only_if_free=True)
    assert machine.seat.holder == "", "the take-over has ended the offer"
