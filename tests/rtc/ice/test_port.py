"""Many agents on one port, and strangers."""

import gc
import heapq
import sys
from random import Random

import pytest

from lockstep.rtc.addresses import Path
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.credentials import new_credentials
from lockstep.rtc.ice.gathering import gather
from lockstep.rtc.ice.port import Port, source_of
from lockstep.rtc.stun import Kind, Message, serialize
from tests.rtc.ice.network import Network, agent_at, candidates_of

CONSOLE = ("198.51.100.7", 5000)
DATA = b"\x17\xfe\xfd" + bytes(20)  # a record of DTLS


class PortNetwork(Network):
    """What goes to the console's address goes through its port."""

    def __init__(self, seed: int = 1) -> None:
        super().__init__(seed)
        self.port = Port()
        self.console_agents: list[Agent] = []

    def peer(self, host: str, port: int = 5000) -> tuple[Agent, Agent]:
        """One of the console's agents, and its peer, which knows of it."""
        number = len(self.console_agents)
        ours = Agent(
            gather([CONSOLE[0]], CONSOLE[1]), controlling=False, directory=self.port.directory, rng=Random(number)
        )
        self.console_agents.append(ours)
        self.events[ours] = []
        theirs = self.add(agent_at(host, port=port, controlling=True, seed=number))
        ours.set_remote(theirs.local_credentials, candidates_of(theirs), self.now)
        theirs.set_remote(ours.local_credentials, candidates_of(ours), self.now)
        return ours, theirs

    def arrive(self, data: bytes, path: Path) -> Agent | None:
        agent = self.port.route(data, path, self.now)
        if agent is not None and data[0] < 4:
            agent.receive_datagram(data, path, self.now)
            self.drain(agent)
        return agent

    def step(self, until: float) -> bool:
        if self._under_way and self._under_way[0][2] == CONSOLE:
            timers = [due for agent in self.events if (due := agent.timer()) is not None]
            due = self._under_way[0][0]
            if due <= until and due < min(timers, default=float("inf")):
                _, _, _, data, path = heapq.heappop(self._under_way)
                self.now = max(self.now, due)
                self.arrive(data, path)
                return True
        return super().step(until)


def check(ours: Agent, theirs: Agent, rng: Random, password: str | None = None) -> bytes:
    request = Message(
        Kind.REQUEST,
        rng.randbytes(12),
        username=f"{ours.local_credentials.ufrag}:{theirs.local_credentials.ufrag}",
        priority=1,
        controlling=1,
    )
    return serialize(request, password or ours.local_credentials.password)


def test_many_agents_share_one_port_and_each_hears_its_own_peer() -> None:
    network = PortNetwork()
    peers = [network.peer(f"192.0.2.{number + 1}") for number in range(10)]
    assert network.run(10, lambda: all(ours.path and theirs.path for ours, theirs in peers))
    for ours, theirs in peers:
        assert theirs.path is not None
        assert network.port.route(DATA, Path(CONSOLE, theirs.path.local), network.now) is ours
    network.run(60)
    assert not any(ours.ended for ours, _ in peers)


def test_two_peers_behind_one_nat_are_told_apart_by_their_ports() -> None:
    network = PortNetwork()
    first, second = network.peer("192.0.2.1", 5000), network.peer("192.0.2.1", 5001)
    assert network.run(10, lambda: first[0].path is not None and second[0].path is not None)
    assert network.port.route(DATA, Path(CONSOLE, ("192.0.2.1", 5001)), network.now) is second[0]


def test_data_that_come_with_the_first_check_are_let_through() -> None:
    network = PortNetwork()
    ours, theirs = network.peer("192.0.2.1")
    path = Path(CONSOLE, ("192.0.2.1", 5000))
    assert network.port.route(DATA, path, network.now) is None
    network.arrive(check(ours, theirs, network.rng), path)
    assert network.port.route(DATA, path, network.now) is ours


def test_a_forged_source_takes_no_address_from_whoever_has_answered_there() -> None:
    network = PortNetwork()
    operator, intruder = network.peer("192.0.2.1"), network.peer("192.0.2.66")
    assert network.run(10, lambda: operator[0].path is not None and intruder[0].path is not None)
    path = Path(CONSOLE, ("192.0.2.1", 5000))
    for _ in range(100):
        network.arrive(check(*intruder, network.rng), path)
        assert network.port.route(DATA, path, network.now) is operator[0]
        network.run(1)
    assert operator[0].path == path
    assert not operator[0].ended


def test_an_address_that_answers_for_another_agent_moves_there() -> None:
    """A NAT has given the port of one that has gone to another."""
    network = PortNetwork()
    gone, _ = network.peer("192.0.2.1")
    assert network.run(10, lambda: gone.path is not None)
    path = Path(CONSOLE, ("192.0.2.1", 5000))
    came, _ = network.peer("192.0.2.1")
    assert network.run(10, lambda: network.port.route(DATA, path, network.now) is came)
    network.run(60)
    assert gone.ended
    assert network.port.route(DATA, path, network.now) is came


def test_the_peer_of_a_restarted_agent_is_known_by_its_new_name() -> None:
    network = PortNetwork()
    ours, theirs = network.peer("192.0.2.1")
    assert network.run(10, lambda: ours.path is not None)
    ours.restart(network.now)
    theirs.restart(network.now)
    ours.set_remote(theirs.local_credentials, [], network.now)
    theirs.set_remote(ours.local_credentials, candidates_of(ours), network.now)
    assert network.run(
        10, lambda: network.port.route(check(ours, theirs, network.rng), Path(CONSOLE, CONSOLE), 0.0) is ours
    )
    network.run(100)
    assert not ours.ended


def test_agents_that_end_leave_nothing_behind() -> None:
    network = PortNetwork()
    peers = [network.peer(f"192.0.2.{number + 1}") for number in range(20)]
    network.run(10)
    for ours, _ in peers:
        ours.restart(network.now)
    network.run(1)
    assert network.port.directory.size > 0
    for ours, _ in peers:
        ours.close()
    assert network.port.directory.size == 0


def test_agents_that_end_by_silence_leave_nothing_behind() -> None:
    network = PortNetwork()
    ours, _ = network.peer("192.0.2.1")
    network.run(10)
    network.conditions.cut = True
    network.run(60)
    assert ours.ended
    assert network.port.directory.size == 0


def strangers(kind: str, ours: Agent, theirs: Agent, rng: Random) -> bytes:
    """What one without the password may send."""
    unknown = Message(Kind.REQUEST, rng.randbytes(12), username=f"{rng.randrange(10**6)}:x", priority=1)
    return {
        "unknown user": lambda: serialize(unknown, "guessed"),
        "known user": lambda: check(ours, theirs, rng, "guessed"),
        "no user": lambda: serialize(Message(Kind.REQUEST, rng.randbytes(12))),
        "answer": lambda: serialize(Message(Kind.SUCCESS, rng.randbytes(12), mapped=("192.0.2.1", 1)), "guessed"),
        "indication": lambda: serialize(Message(Kind.INDICATION, rng.randbytes(12))),
        "data": lambda: DATA,
        "media": lambda: b"\x80\x60" + rng.randbytes(30),
        "noise": lambda: rng.randbytes(100),
        "beginning of STUN": lambda: serialize(unknown)[: rng.randrange(1, 30)],
    }[kind]()


KINDS = ("unknown user", "known user", "no user", "answer", "indication", "data", "media", "noise", "beginning of STUN")


@pytest.mark.parametrize("kind", KINDS)
def test_a_thousand_strangers_without_integrity_make_nothing_grow(kind: str) -> None:
    network = PortNetwork()
    ours, theirs = network.peer("192.0.2.1")
    assert network.run(10, lambda: ours.path is not None)
    network.run(5)
    sent, rng = len(network.sent), Random(5)
    datagrams = [strangers(kind, ours, theirs, rng) for _ in range(3000)]
    paths = [Path(CONSOLE, (f"203.0.{number % 200}.{number % 199}", 1024 + number)) for number in range(1000)]
    for number, data in enumerate(datagrams[:1000]):  # counters and caches have their size after these
        network.arrive(data, paths[number])
    before = footprint(network, ours)
    for number, data in enumerate(datagrams[1000:]):
        network.arrive(data, paths[number % 1000])
    assert footprint(network, ours) == before
    assert len(network.sent) == sent, "strangers get no answer"


def footprint(network: PortNetwork, agent: Agent) -> tuple[int, int, int]:
    """Objects, entries and bytes of everything that a port and an agent hold."""
    seen: dict[int, object] = {}
    todo: list[object] = [network.port, agent]
    while todo:
        each = todo.pop()
        if id(each) in seen or isinstance(each, type) or callable(each):
            continue
        seen[id(each)] = each
        todo += [other for other in gc.get_referents(each) if not isinstance(other, (int, float, str))]
    return len(seen), network.port.directory.size, sum(map(sys.getsizeof, seen.values()))


def heard(network: PortNetwork, agent: Agent, requests: list[bytes], hosts: list[str]) -> int:
    """How many of them are passed on, which come at once from these hosts in turn."""
    paths = [Path(CONSOLE, (host, 9)) for host in hosts]
    return sum(
        network.port.route(data, paths[number % len(paths)], network.now) is agent
        for number, data in enumerate(requests)
    )


def test_requests_from_paths_that_nobody_has_claimed_are_bounded_for_each_source_and_for_all() -> None:
    network = PortNetwork()
    peers = [network.peer(f"192.0.2.{number + 1}") for number in range(30)]
    forged = [[check(*peer, network.rng, "guessed") for _ in range(50)] for peer in peers]
    one_source = sum(heard(network, peers[place][0], forged[place], ["203.0.113.9"]) for place in range(10))
    assert one_source == 200
    many = [f"203.0.{number % 250}.{number // 250}" for number in range(1000)]
    rest = sum(heard(network, peers[place][0], forged[place], many[place * 30 :]) for place in range(10, 30))
    assert one_source + rest == 1000
    assert network.port.counts["requests_over_rate"] == 30 * 50 - 1000
    network.now += 1
    assert heard(network, peers[0][0], forged[0], ["203.0.113.9"]) == 50, "the rate comes back"


def test_a_peer_that_forges_sources_for_its_own_name_keeps_nobody_from_connecting() -> None:
    network = PortNetwork()
    intruder = network.peer("192.0.2.66")
    many = [f"203.0.{number % 250}.{number // 250}" for number in range(5000)]
    assert heard(network, intruder[0], [check(*intruder, network.rng, "guessed")] * 5000, many) <= 100
    ours, theirs = network.peer("192.0.2.1")
    for _ in range(100):
        heard(network, intruder[0], [check(*intruder, network.rng)] * 50, many)
        network.run(0.01)
    assert ours.path is not None
    assert theirs.path is not None


def test_a_peer_that_has_its_path_is_heard_while_strangers_use_up_the_rate() -> None:
    network = PortNetwork()
    ours, theirs = network.peer("192.0.2.1")
    assert network.run(10, lambda: ours.path is not None)
    for _ in range(2000):
        network.arrive(check(ours, theirs, network.rng, "guessed"), Path(CONSOLE, (f"203.0.113.{_ % 256}", 9)))
    assert ours.path is not None
    assert network.port.route(check(ours, theirs, network.rng), ours.path, network.now) is ours


def test_an_ipv6_network_is_one_source() -> None:
    assert source_of("2001:db8::1") == source_of("2001:db8::ffff:1") != source_of("2001:db8:0:1::1")
    assert source_of("fe80::1%eth0") == source_of("fe80::2")
    assert source_of("192.0.2.1") != source_of("192.0.2.2")


def test_credentials_of_agents_on_one_port_differ() -> None:
    assert len({new_credentials().ufrag for _ in range(1000)}) == 1000
