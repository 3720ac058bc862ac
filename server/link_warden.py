"""Ends what a link gave when the link ends: peers at once, viewers of the 3D scene too."""

import asyncio
import time

import structlog

from server.audit import Actor, AuditKind
from server.audit_trail import AuditTrail
from server.invitation_store import InvitationStore
from server.invitations import Invitation
from server.metrics import Metrics
from server.peers import Peers

__all__ = ["LinkWarden"]

log = structlog.get_logger(__name__)

COMMAND_LINE = Actor("command line")
CHECK_SECONDS = 1.0  # how long a link that was revoked by another process still works


class LinkWarden:
    """Run `run` as a task; call `enforce` after inviting or revoking here."""

    def __init__(self, invitations: InvitationStore, peers: Peers, audit: AuditTrail, metrics: Metrics) -> None:
        self._audit = audit
        self._invitations = invitations
        self._peers = peers
        self._metrics = metrics
        self._changed = asyncio.Event()  # replaced whenever something was revoked

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            await asyncio.sleep(CHECK_SECONDS)
            try:
                self.enforce(self._invitations.refresh(), COMMAND_LINE)
            except Exception:
                self._metrics.internal_errors.labels("links").inc()
                log.exception("checking the links failed")

    def enforce(self, changed: list[Invitation], by: Actor) -> None:
        """Act on what `by` has invited or revoked, and on what has expired."""
        for each in changed:
            kind: AuditKind = "invitation" if each.revoked_at is None else "revocation"
            self._audit.record(kind, by, each.role, f"{each.name} ({each.id})")
        now = time.time()
        for peer in self._peers:
            if self._invitations.is_revoked(peer.identity.token_id):
                peer.end("link revoked")
            elif now >= peer.identity.expires:
                peer.end("link expired")
        self._changed.set()
        self._changed = asyncio.Event()

    async def revoked(self, link: str) -> None:
        """Returns when the link with this id is revoked."""
        while not self._invitations.is_revoked(link):
            await self._changed.wait()
