"""A network of agents on a virtual clock: seeded loss, duplication, delay and reordering, cuts, and NATs."""

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.candidates import Candidate
from lockstep.rtc.ice.events import Event
from lockstep.rtc.ice.gathering import gather
from lockstep.rtc.ice.settings import IceSettings

__all__ = ["Conditions", "Network", "agent_at", "connect"]


@dataclass
class Conditions:
    loss: float = 0.0
    duplicates: float = 0.0
    delay: tuple[float, float] = (0.01, 0.01)  # seconds one way, drawn evenly: a wide range reorders
    cut: bool = False


class Network:
    """Datagrams go to the agent that has the address; a NAT is a function that changes paths."""

    def __init__(self, seed: int = 1, conditions: Conditions | None = None) -> None:
        self.now = 1000.0
        self.rng = Random(seed)
        self.conditions = conditions or Conditions()
        self.agents: dict[Address, Agent] = {}
        self.events: dict[Agent, list[Event]] = {}
        self.sent: list[tuple[float, Datagram]] = []
        self.translate: Callable[[Path], Path | None] = lambda path: path
        self._under_way: list[tuple[float, int, Address, bytes, Path]] = []
        self._order = itertools.count()

    def add(self, agent: Agent) -> Agent:
        for local in agent.local_candidates:
            self.agents[local.base] = agent
        self.events[agent] = []
        return agent

    def inject(self, data: bytes, path: Path) -> None:
        """A datagram that arrives now, on a path as its receiver sees it."""
        agent = self.agents[path.local]
        agent.receive_datagram(data, path, self.now)
        self.drain(agent)

    def lose_what_is_under_way(self) -> None:
        self._under_way.clear()

    def drain(self, agent: Agent) -> None:
        for datagram in agent.datagrams_to_send():
            self.sent.append((self.now, datagram))
            self._carry(datagram)
        self.events[agent] += agent.events()

    def _carry(self, datagram: Datagram) -> None:
        """From here on a path is seen from its receiver."""
        path = self.translate(datagram.path)
        if path is None or self.conditions.cut or self.rng.random() < self.conditions.loss:
            return
        for _ in range(2 if self.rng.random() < self.conditions.duplicates else 1):
            due = self.now + self.rng.uniform(*self.conditions.delay)
            arriving = Path(path.remote, path.local, path.transport)
            heapq.heappush(self._under_way, (due, next(self._order), arriving.local, datagram.data, arriving))

    def step(self, until: float) -> bool:
        """The next thing that happens; False when it is after `until`."""
        timers = [(due, agent) for agent in self.events if (due := agent.timer()) is not None]
        next_timer, late = min(timers, key=lambda each: each[0], default=(float("inf"), None))
        next_arrival = self._under_way[0][0] if self._under_way else float("inf")
        if min(next_timer, next_arrival) > until:
            self.now = until
            return False
        self.now = max(self.now, min(next_timer, next_arrival))
        if late is not None and next_timer <= next_arrival:
            late.handle_timer(self.now)
            self.drain(late)
            following = late.timer()
            assert following is None or following > self.now, "a shell would spin"
        else:
            _, _, address, data, path = heapq.heappop(self._under_way)
            agent = self.agents.get(address)
            if agent is not None:
                agent.receive_datagram(data, path, self.now)
                self.drain(agent)
        return True

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Whether `until` came true in time."""
        end = self.now + seconds
        while not until():
            if not self.step(end):
                return until()
        return True


def agent_at(
    *hosts: str, port: int = 5000, controlling: bool = False, seed: int = 0, settings: IceSettings | None = None
) -> Agent:
    return Agent(gather(hosts, port), controlling=controlling, settings=settings, rng=Random(f"{hosts}{port}{seed}"))


def candidates_of(agent: Agent) -> list[Candidate]:
    return [local.candidate for local in agent.local_candidates]


def connect(network: Network, first: Agent, second: Agent) -> None:
    """Signalling, without delay."""
    for one, other in ((first, second), (second, first)):
        if one not in network.events:
            network.add(one)
        one.set_remote(other.local_credentials, candidates_of(other), network.now)
    for each in (first, second):
        network.drain(each)
