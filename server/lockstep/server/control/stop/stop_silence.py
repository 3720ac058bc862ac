"""Silences the stops of links for a supervisor, and tells the peers of these links."""

import time

from lockstep.protocol.console import Notice
from lockstep.protocol.messages import RefusalReason
from lockstep.server.auth.silenced_links import SilencedLinks
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import SessionEvents, SilenceChanged

__all__ = ["SILENCED", "StopSilence"]

SILENCED = (
    "A supervisor has silenced the STOP of your link, and of all links that you invited with it, for ten minutes. "
    "Robots that you stopped stay stopped."
)
HEARD = "The STOP of your link works again."


class StopSilence:
    """The silenced links, at one robot. Every method is called on the loop and returns at once."""

    def __init__(self, links: SilencedLinks, peers: PeerRegistry, events: SessionEvents) -> None:
        """`links`: of all robots of this console."""
        self._links = links
        self._peers = peers
        self._events = events

    def holds(self, link: str) -> bool:
        """True if the stops of this link are silenced."""
        return bool(link) and self._links.holds(link, time.monotonic())

    def silence(self, by: Peer, peer: str, *, silent: bool) -> RefusalReason | None:
        """Silence the stops of the link of `peer` for a supervisor, or end that. Return a refusal's reason, or None."""
        found = self._peers.by_id(peer)
        if by.role != "supervisor" or found is None or found.role == "supervisor":
            return "not_allowed"
        link, now = found.identity.token_id, time.monotonic()
        if silent:
            self._links.silence(link, now)
            self._events.publish(SilenceChanged(by.actor, found.name, link, silent=True))
        elif self._links.hear(link, now):
            self._events.publish(SilenceChanged(by.actor, found.name, link, silent=False))
        self.show()
        return None

    def show(self) -> None:
        """Tell the peers whose stops were silenced, or are heard again, here or at another robot or console."""
        for peer in self._peers:
            silent = self.holds(peer.identity.token_id)
            if silent != peer.silenced:
                peer.silenced = silent
                notice = Notice(level="warning", text=SILENCED) if silent else Notice(level="info", text=HEARD)
                peer.send("session", notice)
