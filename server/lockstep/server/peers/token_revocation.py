"""Ends the peers of a link at once when the link ends, and its viewers of the 3D scene too."""

from typing import Protocol

from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor, AuditKind
from lockstep.server.auth.invitation_store import InvitationStore
from lockstep.server.auth.invitations import Invitation
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.util.broadcast import Broadcast

__all__ = ["UNKNOWN_SECONDS", "TokenRevocation"]

# Connected peers may stay this long while the list of revoked links cannot be read. Newcomers are refused at once; a
# disk that is away for a moment should not take the robot out of somebody's hands.
UNKNOWN_SECONDS = 10.0


class ShownSilence(Protocol):
    """The part of the silenced stops that is needed here."""

    def show(self) -> None:
        """Tell peers whether their stops are silenced."""
        ...


class TokenRevocation:
    """Ends access to one robot. The console context calls `enforce`."""

    def __init__(
        self,
        invitations: InvitationStore,
        peers: PeerRegistry,
        audit: AuditTrail,
        silence: ShownSilence,
        robot: str = "",
    ) -> None:
        self.peers = peers
        self._silence = silence
        self._audit = audit
        self._invitations = invitations
        self._robot = robot
        self._enforced = Broadcast()  # by every `enforce`
        self._trouble_since: float | None = None

    def enforce(self, changed: list[Invitation], by: Actor, now: float) -> None:
        """Act on links that `by` has made or revoked, and on links that have expired. `now` is s since 1970."""
        for each in changed:
            if each.concerns(self._robot):
                kind: AuditKind = "invitation" if each.revoked_at is None else "revocation"
                self._audit.record(kind, by, each.role, f"{each.name} ({each.id})")
        unknown = self._unknown_for(now)
        for peer in self.peers:
            if unknown > UNKNOWN_SECONDS:
                peer.end("links unreadable")
            elif self._invitations.is_revoked(peer.identity.token_id):
                peer.end("link revoked")
            elif now >= peer.identity.expires:
                peer.end("link expired")
        self._silence.show()
        self._enforced.send()

    def silence_ended(self, link: str) -> None:
        """Record that the silence of this link's stops has run out."""
        self._audit.record("silence", what="ended", detail=link)

    async def ended(self, link: str, expires: float) -> None:
        """Wait until the link with this id is revoked or has expired; return at the next `enforce` at the latest."""
        while not self._invitations.has_ended(link, expires):
            if self._unknown_for(self._invitations.clock.now()) > UNKNOWN_SECONDS:
                return
            await self._enforced.wait()

    def _unknown_for(self, now: float) -> float:
        """Return the seconds for which the list of revoked links could not be read."""
        if not self._invitations.trouble:
            self._trouble_since = None
            return 0.0
        self._trouble_since = now if self._trouble_since is None else self._trouble_since
        return now - self._trouble_since
