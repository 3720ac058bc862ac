"""Finds the owner of a datagram, where many agents share sockets: agents enter their users, transactions and paths, and
remove them again."""

from typing import TYPE_CHECKING

from lockstep.rtc.addresses import Path

if TYPE_CHECKING:
    from lockstep.rtc.ice.agent import Agent

__all__ = ["Directory", "Entries"]


class Directory:
    """The entries of all agents. Each belongs to one agent, which alone removes it.

    A path is *claimed* when its far end has answered a check: an attacker with a forged source address never sees the
    check that it would have to answer. A path is *hinted at* when an authenticated check came from there; a hint lets
    data through that overtake the answer, and never takes a path from the agent that has claimed it.
    """

    def __init__(self) -> None:
        self.ufrags: dict[str, Agent] = {}
        self.transactions: dict[bytes, Agent] = {}
        self.claims: dict[Path, Agent] = {}
        self.hints: dict[Path, Agent] = {}

    def owner(self, path: Path) -> "Agent | None":
        """Return the agent that data on this path are for."""
        return self.claims.get(path) or self.hints.get(path)

    def has_owner(self, path: Path) -> bool:
        return self.owner(path) is not None

    def hint(self, path: Path, agent: "Agent") -> None:
        if path not in self.claims:
            self.hints[path] = agent

    def claim(self, path: Path, agent: "Agent") -> None:
        """Enter that the agent's peer is on this path now. A path that another agent had moves."""
        self.claims[path] = agent
        self.hints.pop(path, None)

    def release(self, path: Path, agent: "Agent") -> None:
        for entries in (self.claims, self.hints):
            if entries.get(path) is agent:
                del entries[path]

    @property
    def size(self) -> int:
        """The number of entries of all kinds."""
        return len(self.ufrags) + len(self.transactions) + len(self.claims) + len(self.hints)


class Entries:
    """The entries of one agent. Its sessions, which their ufrags name, share paths: a path is given up when no session
    has it any more."""

    def __init__(self, directory: Directory, agent: "Agent") -> None:
        self._directory = directory
        self._agent = agent
        self._holders: dict[Path, set[str]] = {}  # ufrags of the sessions that have heard from the peer on a path

    def add_user(self, ufrag: str) -> None:
        self._directory.ufrags[ufrag] = self._agent

    def remove_user(self, ufrag: str) -> None:
        self._directory.ufrags.pop(ufrag, None)

    def add_transaction(self, transaction: bytes) -> None:
        self._directory.transactions[transaction] = self._agent

    def remove_transaction(self, transaction: bytes) -> None:
        self._directory.transactions.pop(transaction, None)

    def hint(self, path: Path, ufrag: str) -> None:
        self._holders.setdefault(path, set()).add(ufrag)
        self._directory.hint(path, self._agent)

    def claim(self, path: Path, ufrag: str) -> None:
        self._holders.setdefault(path, set()).add(ufrag)
        self._directory.claim(path, self._agent)

    def release(self, path: Path, ufrag: str) -> None:
        """Note that a session has given up a path."""
        holders = self._holders.get(path, set())
        holders.discard(ufrag)
        if not holders:
            self._holders.pop(path, None)
            self._directory.release(path, self._agent)
