"""The candidates of a session's peer: from signalling, and from its checks."""

from lockstep.rtc.addresses import Path
from lockstep.rtc.ice.candidates import Candidate, foundation
from lockstep.rtc.ice.settings import IceSettings

__all__ = ["RemoteCandidates"]

Key = tuple[str, str, int]  # transport, host, port


class RemoteCandidates:
    """The remote candidates of one session. Each kind has its own bound: checks from many addresses leave room for
    signalled candidates."""

    def __init__(self, settings: IceSettings) -> None:
        self._settings = settings
        self._signalled: dict[Key, Candidate] = {}
        self._reflexive: dict[Key, Candidate] = {}

    def at(self, path: Path) -> Candidate | None:
        key = _key(path)
        return self._signalled.get(key) or self._reflexive.get(key)

    def add_signalled(self, candidate: Candidate) -> bool:
        """Add a signalled candidate. Return False if it is known already (RFC 8445 7.3.1.3), or there are too many."""
        key = (candidate.transport, candidate.host, candidate.port)
        if key in self._signalled or key in self._reflexive:
            return False
        if len(self._signalled) >= self._settings.max_remote_candidates:
            return False
        self._signalled[key] = candidate
        return True

    def add_reflexive(self, path: Path, priority: int) -> Candidate:
        """Add and return the peer-reflexive candidate that a check has shown (RFC 8445 7.3.1.3)."""
        host, port = path.remote
        candidate = Candidate(
            foundation=foundation("prflx", host, path.transport),
            component=1,
            transport=path.transport,
            priority=max(1, min(priority, (1 << 31) - 1)),
            host=host,
            port=port,
            type="prflx",
            tcp_type="active" if path.transport == "tcp" else None,
        )
        self._reflexive[_key(path)] = candidate
        return candidate

    def must_give_way(self) -> list[Candidate]:
        """Return the peer-reflexive candidates, the oldest first, if there is no place for another; else none."""
        if len(self._reflexive) < self._settings.max_peer_reflexive:
            return []
        return list(self._reflexive.values())

    def remove(self, candidate: Candidate) -> None:
        self._reflexive.pop((candidate.transport, candidate.host, candidate.port), None)


def _key(path: Path) -> Key:
    return path.transport, *path.remote
