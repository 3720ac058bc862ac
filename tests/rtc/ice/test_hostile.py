"""Two agents, and somebody between them who sees everything, sends anything, and has no password."""

from random import Random

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from lockstep.rtc.addresses import Path
from lockstep.rtc.ice.events import Ended
from lockstep.rtc.stun import Kind, Message, serialize
from tests.rtc.ice.network import Network, agent_at, candidates_of, connect

HERE, THERE, INTRUDER = ("192.0.2.1", 5000), ("198.51.100.7", 5000), ("203.0.113.66", 6666)
sides = st.sampled_from((0, 1))
sources = st.sampled_from((HERE, THERE, INTRUDER, ("203.0.113.67", 1), ("192.0.2.9", 5000)))


class HostileNetwork(RuleBasedStateMachine):
    @initialize(seed=st.integers(0, 1000), roles=st.tuples(st.booleans(), st.booleans()))
    def meet(self, seed: int, roles: tuple[bool, bool]) -> None:
        self.network = Network(seed)
        self.rng = Random(seed)
        self.agents = (
            agent_at(HERE[0], controlling=roles[0], seed=seed),
            agent_at(THERE[0], controlling=roles[1], seed=seed),
        )
        connect(self.network, *self.agents)
        self.paths = (Path(HERE, THERE), Path(THERE, HERE))
        assert self.network.run(30, lambda: all(agent.path is not None for agent in self.agents))

    @rule(seconds=st.floats(0.0, 20.0))
    def time_passes(self, seconds: float) -> None:
        self.network.run(seconds)

    @rule(side=sides, data=st.binary(max_size=100), source=sources)
    def noise_comes(self, side: int, data: bytes, source: tuple[str, int]) -> None:
        self.network.inject(data, Path(self.paths[side].local, source))

    @rule(side=sides, kind=st.sampled_from(Kind), source=sources, use_candidate=st.booleans())
    def somebody_guesses(self, side: int, kind: Kind, source: tuple[str, int], use_candidate: bool) -> None:
        ours, theirs = self.agents[side].local_credentials, self.agents[1 - side].local_credentials
        message = Message(
            kind,
            self.rng.randbytes(12),
            username=f"{ours.ufrag}:{theirs.ufrag}",
            priority=2**31 - 1,
            use_candidate=use_candidate,
            controlling=2**64 - 1,
            mapped=INTRUDER,
        )
        sent = len(self.network.sent)
        for password in (None, "guessed", theirs.password):
            self.network.inject(serialize(message, password), Path(self.paths[side].local, source))
        assert len(self.network.sent) == sent, "a stranger gets no answer"

    @rule(side=sides, newest=st.integers(1, 50), source=sources)
    def something_recorded_comes_again(self, side: int, newest: int, source: tuple[str, int]) -> None:
        recorded = [each for _, each in self.network.sent if each.remote == self.paths[side].local]
        self.network.inject(recorded[-min(newest, len(recorded))].data, Path(self.paths[side].local, source))

    @rule(side=sides, newest=st.integers(1, 50), bit=st.integers(0, 10_000), source=sources)
    def something_changed_comes(self, side: int, newest: int, bit: int, source: tuple[str, int]) -> None:
        recorded = [each for _, each in self.network.sent if each.remote == self.paths[side].local]
        data = bytearray(recorded[-min(newest, len(recorded))].data)
        data[bit // 8 % len(data)] ^= 1 << bit % 8
        self.network.inject(bytes(data), Path(self.paths[side].local, source))

    @rule()
    def they_restart(self) -> None:
        here, there = self.agents
        for agent in self.agents:
            agent.restart(self.network.now)
        for one, other in ((here, there), (there, here)):
            one.set_remote(other.local_credentials, candidates_of(other), self.network.now)
            self.network.drain(one)

    @invariant()
    def both_send_to_each_other(self) -> None:
        for agent, path in zip(self.agents, self.paths, strict=True):
            assert agent.path == path
            assert not any(isinstance(event, Ended) for event in self.network.events[agent])

    @invariant()
    def nothing_grows(self) -> None:
        for agent in self.agents:
            assert agent._directory.size < 100
            assert set(agent.counts) <= COUNTS

    def teardown(self) -> None:
        if not hasattr(self, "agents"):
            return
        self.network.run(100)
        self.both_send_to_each_other()
        for agent in self.agents:
            agent.close()
            assert agent._directory.size == 0


COUNTS = {
    "answered_400",
    "answered_420",
    "answered_487",
    "candidate_not_added",
    "check_refused",
    "checks_over_rate",
    "indication",
    "malformed",
    "not_stun",
    "too_many_addresses",
    "unauthentic",
    "unexpected_response",
    "unknown_transaction",
    "unknown_username",
}

HostileNetwork.TestCase.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)
TestHostileNetwork = HostileNetwork.TestCase
