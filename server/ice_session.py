"""The ICE side of one connection, as its signalling sees it: a tag for each session, candidates, restarts."""

import secrets
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from rtc.endpoint import Connection
from rtc.ice.candidates import CandidateError, parse_candidate
from rtc.sdp import Fragment as RtcFragment
from rtc.sdp import FragmentCandidate as RtcCandidate
from server.errors import BadSdpFragment
from server.offer import Fragment, FragmentCandidate

__all__ = ["IceSession", "LocalSession", "PatchedSession"]

MAX_CANDIDATES = 100  # of the peer, in one session


class LocalSession(NamedTuple):
    """Our side of a session that a restart has begun."""

    username: str
    password: str
    candidates: list[str]  # "candidate:…"


class PatchedSession(Protocol):
    """What a PATCH of WHEP and WHIP is about."""

    @property
    def tag(self) -> str:
        """Entity tag of the newest ICE session (RFC 9725 4.3.1); a restart changes it."""

    @property
    def username(self) -> str:
        """The peer's, of the newest session."""

    @property
    def connected(self) -> bool: ...

    @property
    def section(self) -> tuple[str, str]:
        """Kind and mid of the section that candidates are for."""

    async def add(self, candidates: Sequence[FragmentCandidate]) -> None:
        """Raises BadSdpFragment: one cannot be used, or they are too many."""

    async def restart(self, fragment: Fragment) -> LocalSession:
        """Raises BadSdpFragment; ConnectionError when the session has ended."""


class IceSession:
    """As `PatchedSession`."""

    def __init__(self, connection: Connection, username: str) -> None:
        """`username`: the offer's."""
        self.tag = _new_tag()
        self.username = username
        self._connection = connection
        self._candidates = 0

    @property
    def connected(self) -> bool:
        return self._connection.peer.ice.path is not None

    @property
    def section(self) -> tuple[str, str]:
        tagged = self._connection.peer.tagged
        return tagged.kind, tagged.mid

    async def add(self, candidates: Sequence[FragmentCandidate]) -> None:
        lines = [_usable(each) for each in candidates]
        self._candidates += len(lines)
        if self._candidates > MAX_CANDIDATES:
            raise BadSdpFragment("too many candidates for one session")
        for line in lines:
            self._connection.add_candidate(line)

    async def restart(self, fragment: Fragment) -> LocalSession:
        theirs = tuple(RtcCandidate(each.mid, _usable(each)) for each in fragment.candidates)
        ours = self._connection.answer_restart(RtcFragment(fragment.username, fragment.password, theirs))
        self.tag, self.username, self._candidates = _new_tag(), fragment.username, len(theirs)
        return LocalSession(ours.ufrag, ours.password, [each.line for each in ours.candidates])


def _usable(each: FragmentCandidate) -> str:
    try:
        if parse_candidate(each.line).is_ip_address:
            return each.line
    except CandidateError:
        pass
    raise BadSdpFragment("a candidate that is not valid")


def _new_tag() -> str:
    return f'"{secrets.token_hex(8)}"'
