"""Ends what a link gave when the link ends: peers at once, viewers of the 3D scene too."""

import asyncio

from server.audit import Actor, AuditKind
from server.audit_trail import AuditTrail
from server.invitation_store import InvitationStore
from server.invitations import Invitation
from server.peers import Peers

__all__ = ["LinkWarden"]


class LinkWarden:
    """Of one robot. The house calls `enforce`."""

    def __init__(self, invitations: InvitationStore, peers: Peers, audit: AuditTrail, robot: str = "") -> None:
        self.peers = peers
        self._audit = audit
        self._invitations = invitations
        self._robot = robot
        self._changed = asyncio.Event()  # replaced whenever something was revoked

    def enforce(self, changed: list[Invitation], by: Actor, now: float) -> None:
        """Act on what `by` has invited or revoked, and on what has expired. `now` is s since 1970."""
        for each in changed:
            if each.concerns(self._robot):
                kind: AuditKind = "invitation" if each.revoked_at is None else "revocation"
                self._audit.record(kind, by, each.role, f"{each.name} ({each.id})")
        for peer in self.peers:
            if self._invitations.is_revoked(peer.identity.token_id):
                peer.end("link revoked")
            elif now >= peer.identity.expires:
                peer.end("link expired")
        self._changed.set()
        self._changed = asyncio.Event()

    def connected(self, link: str) -> int:
        """Peers that are here with the link of this id."""
        return sum(peer.identity.token_id == link for peer in self.peers)

    async def revoked(self, link: str) -> None:
        """Returns when the link with this id is revoked."""
        while not self._invitations.is_revoked(link):
            await self._changed.wait()
