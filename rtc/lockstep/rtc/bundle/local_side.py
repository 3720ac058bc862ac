"""What a peer says of itself in descriptions: its transport, its sections, and the SSRCs that it sends under."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from random import Random

from lockstep.rtc.bundle.settings import OfferedMedia, PeerSettings
from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.rtp.streams import Identity, NegotiatedMedia
from lockstep.rtc.sdp import (
    LocalMedia,
    MediaSection,
    SessionDescription,
    Source,
    SourceGroup,
    Transport,
    answer_to,
    data_section,
    media_section,
    offer_of,
)

__all__ = ["LocalSide"]

DATA_MID = "data"  # mid of the section for channels in an offer of this side
EXTENSION_IDS = (*range(1, 15), *range(16, 256))  # of header extensions; 15 is reserved (RFC 8285 4.2)


@dataclass(slots=True)
class _Ssrcs:
    stream: int
    repair: int


class LocalSide:
    """Writes the descriptions of one peer."""

    def __init__(self, ice: Agent, fingerprint: Fingerprint, settings: PeerSettings, random: Random) -> None:
        self.identity = Identity.new(random)
        self._ice = ice
        self._fingerprint = fingerprint
        self._settings = settings
        self._random = random
        self._session_id = random.getrandbits(62)  # RFC 8829 5.2.1
        self._ssrcs: dict[str, _Ssrcs] = {}  # by mid

    def answer(self, offer: SessionDescription, media: Mapping[str, LocalMedia]) -> SessionDescription:
        """Return the answer to a peer's offer. Raises SdpError."""
        return answer_to(
            offer,
            self._transport(),
            {mid: self._with_sources(mid, own) for mid, own in media.items()},
            max_message_size=self._settings.sctp.max_receive_message,
            session_id=self._session_id,
        )

    def offer(self, media: Sequence[OfferedMedia], *, data: bool) -> SessionDescription:
        """Return an offer, with channels if `data`."""
        uris = dict.fromkeys(uri for each in media for uri in each.media.extensions)
        ids = dict(zip(uris, EXTENSION_IDS, strict=False))
        sections = [media_section(x.mid, x.kind, self._with_sources(x.mid, x.media), ids) for x in media]
        if data:
            sections.append(data_section(DATA_MID, self._settings.sctp.max_receive_message))
        return offer_of(sections, self._transport(), session_id=self._session_id)

    def negotiated(
        self, remote: SessionDescription, answer: SessionDescription, ours: Sequence[MediaSection]
    ) -> list[NegotiatedMedia]:
        """Return the media of a negotiation. `ours`: the answer's sections with the direction of this side."""
        return [
            NegotiatedMedia(
                section,
                own.direction,
                self._ssrcs[section.mid].stream,
                self._ssrcs[section.mid].repair,
                frozenset(source.ssrc for source in (theirs.sources if theirs else ())),
            )
            for section, own in zip(answer.sections, ours, strict=True)
            if section.is_media and not section.rejected
            for theirs in (remote.section(section.mid),)
        ]

    def _transport(self) -> Transport:
        credentials = self._ice.local_credentials
        return Transport(
            ufrag=credentials.ufrag,
            password=credentials.password,
            fingerprints=(self._fingerprint,),
            setup=self._settings.setup,
            candidates=tuple(local.candidate.line() for local in self._ice.local_candidates),
            end_of_candidates=True,
            ice_options=("trickle",),
        )

    def _with_sources(self, mid: str, own: LocalMedia) -> LocalMedia:
        """Return `own` with the SSRCs that this side sends under."""
        ssrcs = self._ssrcs.setdefault(mid, _Ssrcs(self._random.getrandbits(32), self._random.getrandbits(32)))
        names = {"cname": self.identity.cname} | ({"msid": own.msid} if own.msid else {})
        if not any(codec.name.lower() == "rtx" for codec in own.codecs):
            return replace(own, sources=(Source(ssrcs.stream, names),))
        sources = (Source(ssrcs.stream, names), Source(ssrcs.repair, names))
        return replace(own, sources=sources, source_groups=(SourceGroup("FID", (ssrcs.stream, ssrcs.repair)),))
