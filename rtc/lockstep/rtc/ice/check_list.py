"""The check list of one ICE session (RFC 8445 6.1.2), which has one data stream of one component."""

import ipaddress
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

from lockstep.rtc.addresses import Address, Path
from lockstep.rtc.ice.candidates import Candidate, pair_priority

__all__ = ["CheckList", "LocalCandidate", "Pair", "PairState", "bases"]


@dataclass(frozen=True, slots=True)
class LocalCandidate:
    """A local candidate, and the address that its datagrams leave from (RFC 8445 4: its base)."""

    candidate: Candidate
    base: Address


class PairState(Enum):
    """The states of RFC 8445 6.1.2.6 without Frozen, which lets streams and components learn of each other's success.

    With one stream of one component there is nothing to learn, and a peer that gives everything one foundation would
    have its pairs tried one after the other, 40 s each.
    """

    WAITING = "waiting"
    IN_PROGRESS = "in progress"
    SUCCEEDED = "succeeded"
    FAILED = "failed"


@dataclass(slots=True, eq=False)
class Pair:
    """A local candidate and a remote one."""

    path: Path  # from the local base: the peer sees its datagrams coming from the local candidate
    local: Candidate
    remote: Candidate
    state: PairState = PairState.WAITING
    heard: bool = False  # an authenticated check or answer came on it
    nominated: bool = False
    nominated_by_peer: bool = False  # a check with USE-CANDIDATE came; one from this side decides (RFC 8445 7.3.1.5)
    answered_at: float | None = None  # time of the last answer to a check on it

    def priority(self, controlling: bool) -> int:
        ours, theirs = self.local.priority, self.remote.priority
        return pair_priority(ours, theirs) if controlling else pair_priority(theirs, ours)


class CheckList:
    """The pairs of a session, by path. A path has one pair: candidates that share a base are one (RFC 8445 6.1.2.4)."""

    def __init__(self, max_pairs: int) -> None:
        self._max_pairs = max_pairs
        self.pairs: dict[Path, Pair] = {}

    def add(self, locals_: Iterable[LocalCandidate], remote: Candidate) -> None:
        """Form pairs with a remote candidate (RFC 8445 6.1.2.2)."""
        for local in locals_:
            path = Path(local.base, remote.address, local.candidate.transport)
            if path not in self.pairs and may_pair(local, remote):
                self.pairs[path] = Pair(path, local.candidate, remote)

    def trim(self, controlling: bool, in_use: Pair | None) -> list[Pair]:
        """Remove and return the pairs beyond the bound: the worst that have not succeeded (RFC 8445 6.1.2.5)."""
        removed: list[Pair] = []
        while len(self.pairs) > self._max_pairs:
            others = [pair for pair in self.pairs.values() if pair is not in_use]
            untried = [pair for pair in others if pair.state is not PairState.SUCCEEDED]
            removed.append(min(untried or others, key=lambda pair: pair.priority(controlling)))
            del self.pairs[removed[-1].path]
        return removed

    def next_ordinary(self, controlling: bool) -> Pair | None:
        """Return the pair to check next, without triggered ones (RFC 8445 6.1.4.2)."""
        waiting = (pair for pair in self.pairs.values() if pair.state is PairState.WAITING)
        return max(waiting, key=lambda pair: pair.priority(controlling), default=None)

    def remove_undecided(self) -> list[Pair]:
        """Remove and return the pairs that have not succeeded: a nomination ends their checks (RFC 8445 8.1.2)."""
        removed = [pair for pair in self.pairs.values() if pair.state is not PairState.SUCCEEDED]
        for pair in removed:
            del self.pairs[pair.path]
        return removed

    def unresolved(self) -> list[Pair]:
        """Return the pairs that may still succeed."""
        settled = (PairState.SUCCEEDED, PairState.FAILED)
        return [pair for pair in self.pairs.values() if pair.state not in settled]


def may_pair(local: LocalCandidate, remote: Candidate) -> bool:
    if local.candidate.component != remote.component or local.candidate.transport != remote.transport:
        return False
    if local.candidate.transport == "tcp" and (local.candidate.tcp_type, remote.tcp_type) != ("active", "passive"):
        return False  # RFC 6544 6.2: the passive side learns of a pair when the connection arrives
    here, there = ipaddress.ip_address(local.base[0]), ipaddress.ip_address(remote.host)
    if here.version != there.version:
        return False
    return here.version == 4 or here.is_link_local == there.is_link_local  # RFC 8445 6.1.2.2


def bases(candidates: Sequence[LocalCandidate]) -> list[LocalCandidate]:
    """Return the best candidate of each base: others leave from the same address and prove nothing more."""
    best: dict[tuple[Address, str], LocalCandidate] = {}
    for each in sorted(candidates, key=lambda local: -local.candidate.priority):
        best.setdefault((each.base, each.candidate.transport), each)
    return list(best.values())
