"""The ICE side of one connection, as its signalling sees it: a tag for each session, candidates, restarts."""

import secrets
from collections.abc import Sequence

from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer import PeerNotReady
from lockstep.rtc.sdp import Fragment, FragmentCandidate
from lockstep.server.errors import BadSdpFragment, NotConnected
from lockstep.server.webrtc.sdp_offer import MAX_CANDIDATES

__all__ = ["IceSession"]


class IceSession:
    """The ICE session that a PATCH of WHEP or WHIP changes.

    Attributes:
        tag: entity tag of the newest ICE session (RFC 9725 4.3.1); a restart changes it
        username: the peer's username fragment in the newest session
    """

    def __init__(self, connection: Connection, username: str) -> None:
        """`username`: the offer's username fragment."""
        self.tag = _new_tag()
        self.username = username
        self._connection = connection
        self._candidates = 0

    @property
    def connected(self) -> bool:
        """True if connected, or connected until consent expired while a restart looks for another path."""
        return self._connection.peer.is_up

    @property
    def has_path(self) -> bool:
        return self._connection.peer.ice.path is not None

    @property
    def section(self) -> tuple[str, str]:
        """Kind and mid of the section that candidates are for."""
        tagged = self._connection.peer.negotiation.tagged
        return tagged.kind, tagged.mid

    def add(self, candidates: Sequence[FragmentCandidate]) -> None:
        """Add candidates of the peer. Raises BadSdpFragment: they are too many."""
        if self._candidates + len(candidates) > MAX_CANDIDATES:
            raise BadSdpFragment("too many candidates for one session")
        self._candidates += len(candidates)
        for each in candidates:
            self._connection.add_candidate(each.line)

    def restart(self, fragment: Fragment) -> Fragment:
        """Begin the peer's new session; return the console's fragment. Raises NotConnected."""
        try:
            ours = self._connection.answer_restart(fragment)
        except PeerNotReady as error:
            raise NotConnected("the ICE session has ended") from error
        self.tag, self.username, self._candidates = _new_tag(), fragment.ufrag, len(fragment.candidates)
        return ours


def _new_tag() -> str:
    return f'"{secrets.token_hex(8)}"'
