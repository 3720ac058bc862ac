"""The check list of one ICE session (RFC 8445 6.1.2), which has one data stream of one component."""

import ipaddress
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

from lockstep.rtc.addresses import Address, Path
from lockstep.rtc.ice.candidates import Candidate, TcpType, candidate_priority, foundation, pair_priority
from lockstep.rtc.ice.remote_candidates import RemoteCandidates
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.settings import IceSettings

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
    """The pairs of a session, by path, and the candidates that form them. A path has one pair: candidates that share a
    base are one (RFC 8445 6.1.2.4)."""

    def __init__(self, candidates: Iterable[LocalCandidate], role: Role, settings: IceSettings) -> None:
        self.pairs: dict[Path, Pair] = {}
        self.remotes = RemoteCandidates(settings)
        self._locals = bases(list(candidates))
        self._role = role
        self._settings = settings

    def add(self, remote: Candidate, in_use: Pair | None) -> list[Pair]:
        """Form pairs with a remote candidate (RFC 8445 6.1.2.2). Return the pairs that made place for others."""
        for local in self._locals:
            path = Path(local.base, remote.address, local.candidate.transport)
            if path not in self.pairs and may_pair(local, remote):
                self.pairs[path] = Pair(path, local.candidate, remote)
        return self._trim(in_use)

    def add_shown(self, path: Path, priority: int, in_use: Pair | None, now: float) -> list[Pair] | None:
        """Add a pair that a check has shown. Its address may be new: a peer-reflexive candidate (7.3.1.3).

        Return the pairs that made place for others; None: there was no place.
        """
        removed: list[Pair] = []
        remote = self.remotes.at(path)
        if remote is None:
            given_way = self._make_place_for_reflexive(in_use, now)
            if given_way is None:
                return None
            removed += given_way
            remote = self.remotes.add_reflexive(path, priority)
        self.pairs[path] = Pair(path, self._local_at(path), remote)
        return removed + self._trim(in_use)

    def _make_place_for_reflexive(self, in_use: Pair | None, now: float) -> list[Pair] | None:
        """Make place for a new address: one that has not answered of late gives way, for the peer has left it, or was
        never there. Return its pairs; None if none gives way."""
        crowd = self.remotes.must_give_way()
        for candidate in crowd:
            pairs = [pair for pair in self.pairs.values() if pair.remote is candidate]
            if not any(pair is in_use or self.is_fresh(pair, now) for pair in pairs):
                self.remotes.remove(candidate)
                for pair in pairs:
                    del self.pairs[pair.path]
                return pairs
        return None if crowd else []

    def _local_at(self, path: Path) -> Candidate:
        """Return the candidate whose base was asked; an address without a candidate counts as a host candidate."""
        for local in self._locals:
            if local.base == path.local and local.candidate.transport == path.transport:
                return local.candidate
        host, port = path.local
        tcp_type: TcpType | None = "passive" if path.transport == "tcp" else None
        name, priority = foundation("host", host, path.transport), candidate_priority("host", 0, tcp_type)
        return Candidate(name, 1, path.transport, priority, host, port, "host", tcp_type=tcp_type)

    def _trim(self, in_use: Pair | None) -> list[Pair]:
        """Remove and return the pairs beyond the bound: the worst that have not succeeded (RFC 8445 6.1.2.5)."""
        removed: list[Pair] = []
        while len(self.pairs) > self._settings.max_pairs:
            others = [pair for pair in self.pairs.values() if pair is not in_use]
            untried = [pair for pair in others if pair.state is not PairState.SUCCEEDED]
            removed.append(min(untried or others, key=self._priority))
            del self.pairs[removed[-1].path]
        return removed

    def _priority(self, pair: Pair) -> int:
        return pair.priority(self._role.controlling)

    def next_ordinary(self) -> Pair | None:
        """Return the pair to check next, without triggered ones (RFC 8445 6.1.4.2)."""
        waiting = (pair for pair in self.pairs.values() if pair.state is PairState.WAITING)
        return max(waiting, key=self._priority, default=None)

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

    def is_fresh(self, pair: Pair, now: float) -> bool:
        """True if the peer has answered on it of late."""
        return pair.answered_at is not None and now - pair.answered_at < self._settings.consent_seconds

    def best(self, now: float) -> Pair | None:
        """Return the best pair that works."""
        works = (pair for pair in self.pairs.values() if self.is_fresh(pair, now))
        return max(works, key=self._priority, default=None)


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
