"""Shares one UDP port among many ICE agents: finds the owner of each datagram, and bounds the cost of strangers.

No datagram of a stranger makes a table grow: until MESSAGE-INTEGRITY holds, the only state is a table of a fixed size.
The checks of that run from the cheap to the expensive:

1. A response must name a transaction that an agent has begun; a request must name a user that exists. Both are one look
   into a dictionary, and an attacker who has not seen the signalling cannot guess either.
2. From a path that the agent has not claimed, requests pass a rate limit for their source, one for the agent, and one
   for all together: a sender with a user's name, a peer or an eavesdropper, uses up that user's rate alone.
3. The agent checks the integrity, and only then remembers anything.
"""

import ipaddress
from collections import Counter
from dataclasses import dataclass

from lockstep.rtc.addresses import Path
from lockstep.rtc.demux import DatagramKind, datagram_kind
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.directory import Directory
from lockstep.rtc.stun import Kind, transaction_of, username_of
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["Port", "PortSettings"]


@dataclass(frozen=True, slots=True)
class PortSettings:
    """Bounds for datagrams from paths that their agent has not claimed."""

    source_rate: float = 100.0  # requests a second from one address (IPv6: network): several browsers that connect
    source_burst: float = 200.0
    total_rate: float = 1000.0  # requests a second from all together: 1.5 % of a core for their integrity
    total_burst: float = 1000.0
    source_slots: int = 4096  # sources that share a slot share its rate


class Port:
    """Routes datagrams to agents. Give agents `directory`; hand a datagram to the agent that `route` returns."""

    def __init__(self, settings: PortSettings | None = None) -> None:
        self.directory = Directory()
        self.counts: Counter[str] = Counter()  # dropped datagrams, by reason
        self._limit = SourceLimit(settings or PortSettings())

    def route(self, data: bytes, path: Path, now: float) -> Agent | None:
        """Return the agent that this datagram is for; None: drop it."""
        kind = datagram_kind(data)
        if kind is DatagramKind.STUN:
            return self._route_stun(data, path, now)
        agent = None if kind is DatagramKind.UNKNOWN else self.directory.owner(path)
        if agent is None:
            self.counts["unknown_source" if kind is not DatagramKind.UNKNOWN else "unknown_protocol"] += 1
        return agent

    def _route_stun(self, data: bytes, path: Path, now: float) -> Agent | None:
        head = transaction_of(data)
        if head is None:
            self.counts["malformed"] += 1
            return None
        kind, transaction = head
        if kind is Kind.REQUEST:
            return self._route_request(data, path, now)
        agent = self.directory.owner(path) if kind is Kind.INDICATION else self.directory.transactions.get(transaction)
        if agent is None:
            self.counts["unknown_transaction"] += 1
        return agent

    def _route_request(self, data: bytes, path: Path, now: float) -> Agent | None:
        agent = self.directory.ufrags.get((username_of(data) or "").partition(":")[0])
        if agent is None:
            self.counts["unknown_username"] += 1
        elif self.directory.claims.get(path) is not agent and not self._limit.take(path.remote[0], agent, now):
            self.counts["requests_over_rate"] += 1
            agent = None
        return agent


class SourceLimit:
    """Limits the rate of each source, of each agent and of all together, in memory of a fixed size."""

    def __init__(self, settings: PortSettings) -> None:
        # A dictionary of sources would grow with forged ones, or forget honest ones. Python seeds the hash of texts
        # anew in each process, so that no sender can choose a slot to share.
        self._sources = [TokenBucket(settings.source_rate, settings.source_burst) for _ in range(settings.source_slots)]
        self._total = TokenBucket(settings.total_rate, settings.total_burst)

    def take(self, host: str, agent: Agent, now: float) -> bool:
        slot = hash(source_of(host)) % len(self._sources)
        return self._sources[slot].take(now) and agent.unclaimed.take(now) and self._total.take(now)


def source_of(host: str) -> str:
    """Return the address, or the network of an IPv6 address: its holder has all 2⁶⁴ addresses of that."""
    return host if ":" not in host else ipaddress.IPv6Address(host).packed[:8].hex()
