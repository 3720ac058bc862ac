"""What both sides of one session tell each other by signalling: offer, answer, candidates, restarts of ICE."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from lockstep.rtc.bundle.local_side import LocalSide
from lockstep.rtc.bundle.settings import OfferedMedia, PeerNotReady
from lockstep.rtc.dtls import DtlsRole
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.candidates import CandidateError, parse_candidate
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.rtp.streams import NegotiatedMedia
from lockstep.rtc.sdp import (
    Fragment,
    FragmentCandidate,
    LocalMedia,
    MediaSection,
    SdpError,
    SessionDescription,
    Transport,
    check_answer,
    reverse,
)

__all__ = ["Agreement", "Negotiation"]


@dataclass(frozen=True, slots=True)
class Agreement:
    """The result of an offer and its answer."""

    role: DtlsRole  # that of this side
    remote: Transport
    media: list[NegotiatedMedia]
    channels: MediaSection | None  # the peer's section for data channels; None: there are none


class Negotiation:
    """One offer and its answer, then restarts of ICE (RFC 8445 9, RFC 8842 5.1): DTLS and SRTP stay, the path
    changes."""

    def __init__(self, ice: Agent, local: LocalSide, counts: Counter[str]) -> None:
        """`counts`: those of the peer."""
        self._ice = ice
        self._local = local
        self._counts = counts
        self._offer: SessionDescription | None = None  # the offer of this side, until it is answered
        self._tagged: MediaSection | None = None  # section with the transport of the bundle; None until negotiated
        self._is_done = False

    def agree_on(
        self, offer: SessionDescription, media: Mapping[str, LocalMedia]
    ) -> tuple[SessionDescription, Agreement]:
        """Return the answer to a peer's offer, for `Peer.answer`. Raises like it."""
        self._check_new()
        answer = self._local.answer(offer, media)
        return answer, self._agreed(offer, answer, answer.sections)

    def offer(self, media: Sequence[OfferedMedia], *, data: bool = True) -> SessionDescription:
        """Return an offer, with channels if `data`. The answer goes to `Peer.accept`. Raises RuntimeError like
        `Peer.answer`."""
        self._check_new()
        self._offer = self._local.offer(media, data=data)
        return self._offer

    def agree_with(self, answer: SessionDescription) -> Agreement:
        """Take the peer's answer, for `Peer.accept`. Raises like it."""
        if self._offer is None:
            raise RuntimeError("no offer waits for an answer")
        check_answer(self._offer, answer)
        self._offer = None
        ours = [replace(section, direction=reverse(section.direction)) for section in answer.sections]
        return self._agreed(answer, answer, ours)

    def _check_new(self) -> None:
        if self._is_done:
            raise RuntimeError("this session is negotiated; another one is another peer")

    def _agreed(
        self, remote: SessionDescription, answer: SessionDescription, ours: Sequence[MediaSection]
    ) -> Agreement:
        """Return the result. `ours`: the answer's sections with the direction of this side."""
        self._tagged = next(iter(answer.accepted), None)
        media = self._local.negotiated(remote, answer, ours)
        self._is_done = True
        we_answer = remote is not answer
        is_client = (answer.transport.setup == "active") is we_answer
        data = next((each for each in answer.accepted if each.sctp_port is not None), None)
        channels = remote.section(data.mid) if data is not None else None
        return Agreement("client" if is_client else "server", remote.transport, media, channels)

    def begin_ice(self, remote: Transport, now: float) -> None:
        """Let ICE look for the first path."""
        self._ice.set_remote(Credentials(remote.ufrag, remote.password), (), now)
        for line in remote.candidates:
            self.add_candidate(line)

    def add_candidate(self, line: str) -> None:
        """Add a remote candidate, "candidate:…" (RFC 8838). An unknown candidate is counted and ignored."""
        try:
            self._ice.add_remote_candidate(parse_candidate(line))
        except CandidateError:
            self._counts["candidate_malformed"] += 1

    @property
    def tagged(self) -> MediaSection:
        """The section that candidates are for (RFC 9143 7.2.1). Raises PeerNotReady before both descriptions."""
        if self._tagged is None:
            raise PeerNotReady("not negotiated yet")
        return self._tagged

    # Restarts

    def restart(self, now: float, candidates: Iterable[LocalCandidate] | None = None) -> Fragment:
        """Look for another path. Return the fragment for the peer, whose answer goes to `accept_restart`.

        `Restarted` or `RestartFailed` follows. Until then the path is the one before, for as long as the peer consents.
        `candidates`: the addresses for the peer now; None: those of before. Raises PeerNotReady.
        """
        if self._ice.ended:
            raise PeerNotReady("the session has ended")
        mid = self.tagged.mid
        credentials = self._ice.restart(now, candidates)
        lines = (local.candidate.line() for local in self._ice.local_candidates)
        found = tuple(FragmentCandidate(mid, line) for line in lines)
        return Fragment(credentials.ufrag, credentials.password, found, end_of_candidates=True)

    def accept_restart(self, fragment: Fragment, now: float) -> None:
        """Take the peer's answer to the fragment of `restart`.

        Raises:
            SdpError: it has no credentials; the restart waits for a better one.
            RuntimeError: no restart waits for it.
        """
        _check_credentials(fragment)
        self._ice.set_remote(Credentials(fragment.ufrag, fragment.password), (), now)
        for candidate in fragment.candidates:
            self.add_candidate(candidate.line)

    def answer_restart(
        self, fragment: Fragment, now: float, candidates: Iterable[LocalCandidate] | None = None
    ) -> Fragment:
        """Return the answer to the fragment of a restart that the peer has begun. Raises SdpError and PeerNotReady."""
        _check_credentials(fragment)
        answer = self.restart(now, candidates)
        self.accept_restart(fragment, now)
        return answer


def _check_credentials(fragment: Fragment) -> None:
    if not fragment.ufrag or not fragment.password:
        raise SdpError("no ice-ufrag or no ice-pwd")
